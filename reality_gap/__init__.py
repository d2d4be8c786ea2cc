"""Reality gap: names what a MuJoCo model gets wrong, from logs of the machine.

A study is a model with logs. A diagnosis compares replays of the model with the logs and has one of
four verdicts: nothing is wrong, named causes with parameters and confidences, named causes that
explain a part of the difference, or a difference that no known cause explains.

    from reality_gap import diagnose, load_study

    diagnosis = diagnose(load_study("STUDY.yaml"))
    print(diagnosis.sentence)

The public names are imported when they are first used; ``__init__.pyi`` lists them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
