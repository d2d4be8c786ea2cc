"""Functions have at most 60 lines, and more than 50 of code only where most of it is a table."""

from __future__ import annotations

import ast
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LONGEST, LONGEST_WITHOUT_TABLE = 60, 50
TABLE_SHARE = 0.5
"""Share of a function's code that its longest literal has, if the function is a table."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


def too_long(source: str) -> list[str]:
    """Names and lengths of the functions of a source that are too long."""
    functions = (node for node in ast.walk(ast.parse(source)) if isinstance(node, Function))
    return [
        f"{function.name}: {_lines(function)} lines" for function in functions if _long(function)
    ]


def _long(function: Function) -> bool:
    docstring = _docstring(function)
    code = _lines(function) - (0 if docstring is None else _lines(docstring))
    table = max(
        (_lines(node) for node in ast.walk(function) if _is_table(node) and node is not docstring),
        default=0,
    )
    return _lines(function) > LONGEST or (
        code > LONGEST_WITHOUT_TABLE and table < TABLE_SHARE * code
    )


def _lines(node: ast.AST) -> int:
    return int(node.end_lineno - node.lineno + 1)  # type: ignore[attr-defined]


def _is_table(node: ast.AST) -> bool:
    literal = ast.List | ast.Tuple | ast.Dict | ast.Set | ast.JoinedStr | ast.Constant
    return isinstance(node, literal)


def _docstring(function: Function) -> ast.expr | None:
    first = function.body[0]
    return first.value if isinstance(first, ast.Expr) else None


def test_functions_are_short() -> None:
    listed = subprocess.check_output(["git", "ls-files", "*.py"], cwd=ROOT, text=True)
    files = [ROOT / line for line in listed.splitlines()]
    found = [
        f"{file.relative_to(ROOT)}: {name}"
        for file in files
        if file.exists()
        for name in too_long(file.read_text(encoding="utf-8"))
    ]
    assert not found


def test_a_long_function_is_found_and_a_long_table_is_not() -> None:
    body = "".join(f"    x = {i}\n" for i in range(50))
    table = "    return [\n" + "".join(f"        {i},\n" for i in range(55)) + "    ]\n"
    assert too_long(f"def long():\n{body}") == ["long: 51 lines"]
    assert too_long(f"def table():\n{table}") == []
    assert too_long("def table():\n" + table.replace("0,\n", "0,\n\n")) == ["table: 64 lines"]
