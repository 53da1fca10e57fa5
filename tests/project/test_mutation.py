"""The mutation run: its faults are faults, one at a time, and the same for the same seed."""

import ast
from pathlib import Path

import pytest

from mutation import mutants

ROOT = Path(__file__).resolve().parents[2]
CODE = '''
"""A docstring with 2 numbers."""
LIMIT: Annotated[float, "s", "longest", Gt(0)] = 0.5


@dataclass(frozen=True)
class One:
    """Not 3."""

    size: int = 4


def area(width: float, height: float = 2.0, *, closed=True) -> float:
    """Width times height."""
    found = []
    for k in range(3):
        if k < 1 and not closed:
            continue
        if width < 0.1:
            width = max(k, width)
        found.append(pow(width, k) * height)
    if TYPE_CHECKING:
        from nowhere import 5
    return sum(found, start=0) if found else f"{width + 1:.3f}"
'''.replace("import 5", "import five")
LIMIT, HEAD = (
    "LIMIT: Annotated[float, 's', 'longest', {}] = {}",
    "def area(width: float, height: float={}, *, closed={}) -> float:",
)
LAST = "return {} if {} else f'{{{}:.3f}}'"
FAULTS = [
    LIMIT.format("Gt(1)", "0.5"),
    LIMIT.format("Gt(0)", "1.0"),
    "size: int = 5",
    HEAD.format("4.0", "True"),
    HEAD.format("2.0", "False"),
    "for k in range(4):",
    "if k < 1 or not closed:",
    "if k <= 1 and (not closed):",
    "if k < 2 and (not closed):",
    "if not (k < 1 and (not closed)):",
    "pass",  # continue
    "if width >= 0.1:",
    "if width < 0.2:",
    "if not width < 0.1:",
    "width = min(k, width)",
    "pass",  # append
    "found.append(pow(width, k) / height)",
    "found.append(pow(k, width) * height)",
    LAST.format("sum(found)", "found", "width + 1"),
    LAST.format("sum(found, start=1)", "found", "width + 1"),
    LAST.format("sum(found, start=0)", "not found", "width + 1"),
    LAST.format("sum(found, start=0)", "found", "width - 1"),
    LAST.format("sum(found, start=0)", "found", "width + 2"),
]


@pytest.fixture
def faults(tmp_path):
    (tmp_path / "code.py").write_text(CODE)
    return [mutants.mutant(tmp_path, "code.py", i) for i in range(mutants.count(tmp_path, "code.py"))]


def test_every_operator_number_condition_call_and_statement_has_its_fault(faults):
    assert sorted(one.after for one in faults) == sorted(FAULTS)


def test_a_fault_is_one_change_of_code_that_can_be_read(faults):
    plain = ast.unparse(ast.parse(CODE)).splitlines()
    for one in faults:
        lines = ast.unparse(ast.parse(one.text)).splitlines()
        assert len(lines) == len(plain)
        assert sum(a != b for a, b in zip(lines, plain, strict=True)) == 1
        assert CODE.splitlines()[one.line - 1].strip().startswith(one.before[:5])


def test_equivalent_faults_stand_with_their_file_and_a_reason():
    lines = (ROOT / "tools" / "mutation" / "equivalent.txt").read_text(encoding="utf-8").splitlines()
    for line in lines:
        fault, _, reason = line.partition("  # ")
        path, _, change = fault.partition(": ")
        assert (ROOT / path).is_file(), line
        assert " => " in change, line
        assert reason, line
        before = change.partition(" => ")[0]
        code = ast.unparse(ast.parse((ROOT / path).read_text(encoding="utf-8")))
        assert before.split("\\n")[0] in code, line
