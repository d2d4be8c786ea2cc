"""Networks in torch, and how they are trained.

No other module imports torch, and no other package imports these modules: they run in the process
that `jmm_agent.mapping.torch_process` starts.
"""
