"""Diagnose a log: what does the nominal model of a recorded elbow get wrong?

Records 20 s of an actual robot, which stands for your machine, then asks which causes its model
lacks. Your own study is a folder with STUDY.yaml, a model and logs; see docs/reality_gap.md.
"""

from pathlib import Path

import kengoro
from reality_gap import Options, diagnose, load_study, write_diagnosis

FOLDER = Path("out/diagnose_a_log")

study_file = kengoro.record(FOLDER / "log", robot=1, arm="elbow", duration=20.0)
study = load_study(study_file)
diagnosis = diagnose(study, jobs=2, options=Options(suggest=False))

print(diagnosis.verdict.value, "-", diagnosis.sentence)
for cause in diagnosis.causes:
    for name, estimate in cause.parameters.items():
        print(f"  {cause.candidate.cause.id} at {cause.candidate.location}: {name} ", end="")
        print(f"{estimate.value:.3g} [{estimate.low:.3g}, {estimate.high:.3g}] {estimate.unit}")
write_diagnosis(diagnosis, study, FOLDER / "diagnosis")
print(f"Report: {FOLDER}/diagnosis/report.html")
