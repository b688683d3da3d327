"""The house itself: what is imported is this checkout, and its rooms are small."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("sim", "pod", "surrogates", "selection", "suffice")
SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
LONGEST_FILE, LONGEST_FUNCTION = 300, 60
HEAVY = ("torch", "numba", "h5py", "scipy", "numpy", "plotly", "lightning", "pydantic")


@pytest.mark.parametrize("package", PACKAGES)
def test_the_package_that_is_imported_is_this_checkouts(package):
    assert Path(importlib.import_module(package).__file__) == ROOT / package / "__init__.py"


def test_help_waits_for_no_heavy_import():
    command = f"import sys, suffice.__main__; print([name for name in {HEAVY} if name in sys.modules])"
    found = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_no_file_is_long():
    long = {str(path): n for path in SOURCES if (n := len(path.read_text().splitlines())) > LONGEST_FILE}
    assert not long


def test_no_function_is_long():
    long = {}
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef):
                n = (node.end_lineno or 0) - node.lineno
                long |= {f"{path.name}: {node.name}": n} if n > LONGEST_FUNCTION else {}
    assert not long


def test_the_four_packages_know_nothing_of_each_other_nor_of_suffice():
    for package in PACKAGES[:-1]:
        others = set(PACKAGES) - {package}
        for path in (ROOT / package).rglob("*.py"):
            imported = set()
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Import):
                    imported |= {name.name.split(".")[0] for name in node.names}
                elif isinstance(node, ast.ImportFrom):
                    imported.add((node.module or "").split(".")[0])
            assert not imported & others, path


def test_every_file_says_in_its_first_line_what_it_is():
    silent = [str(path) for path in SOURCES if not (ast.get_docstring(ast.parse(path.read_text())) or "").strip()]
    assert not silent
