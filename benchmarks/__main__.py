"""`python -m benchmarks NAME [NAME ...]` runs benchmarks; without a name it lists them."""

import ast
import importlib
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parent


def names() -> list[str]:
    """Names of the benchmarks: the modules of this folder that do not begin with an underscore."""
    return sorted(path.stem for path in FOLDER.glob("*.py") if not path.stem.startswith("_"))


def summary(name: str) -> str:
    """First line of the benchmark's docstring, read without importing it."""
    docstring = ast.get_docstring(ast.parse((FOLDER / f"{name}.py").read_text(encoding="utf-8")))
    return (docstring or "").partition("\n")[0]


def main(arguments: list[str]) -> int:
    """Run the benchmarks named in `arguments`, in order; returns the exit code."""
    available = names()
    if not arguments or {"-h", "--help"} & set(arguments):
        print("usage: python -m benchmarks NAME [NAME ...]\n")
        for name in available:
            print(f"{name:<20} {summary(name)}")
        return 0
    unknown = [name for name in arguments if name not in available]
    if unknown:
        listed = ", ".join(available) or "none"
        print(f"There is no benchmark {unknown[0]!r}; there are: {listed}.", file=sys.stderr)
        return 2
    for name in arguments:
        importlib.import_module(f"benchmarks.{name}").main()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
