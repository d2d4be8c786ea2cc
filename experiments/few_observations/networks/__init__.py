"""Networks of the authors' later papers, in torch: how they start at a drawing, and how they learn.

They run in the process that `jmm_agent.mapping.torch_process` starts, and nothing but each other
imports them. `experiments.few_observations.tension_maps` evaluates what they return, without torch.
"""
