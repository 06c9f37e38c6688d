"""The direction rule: who may import whom, read from the source, and what an import starts."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("fgf_warp", "usd_scenes", "generators")

ALLOWED = {
    "fgf_warp.errors": (),
    "fgf_warp.locks": ("fgf_warp.errors",),
    "fgf_warp.theory": (),
    "fgf_warp.scene": ("fgf_warp.errors", "fgf_warp.theory"),
    "fgf_warp.settings": ("fgf_warp.errors", "fgf_warp.theory"),
    "fgf_warp.result": ("fgf_warp.settings",),
    "fgf_warp.features": ("fgf_warp.errors", "fgf_warp.scene", "fgf_warp.settings"),
    "fgf_warp.device": (),
    "fgf_warp.integrator": ("fgf_warp.device", "fgf_warp.features", "fgf_warp.settings"),
    "fgf_warp.bvh_kernel": (),
    "fgf_warp.headers": (),
    "fgf_warp.bvh_splitting": ("fgf_warp.bvh_kernel",),
    "fgf_warp.bvh": ("fgf_warp.bvh_kernel", "fgf_warp.bvh_splitting", "fgf_warp.headers"),
    "fgf_warp.upload": (
        "fgf_warp.bvh",
        "fgf_warp.device",
        "fgf_warp.errors",
        "fgf_warp.integrator",
        "fgf_warp.scene",
        "fgf_warp.settings",
        "fgf_warp.theory",
        "fgf_warp.upload_instances",
        "fgf_warp.upload_lights",
        "fgf_warp.upload_meshes",
        "fgf_warp.upload_shading",
    ),
    "fgf_warp.upload_instances": (
        "fgf_warp.device",
        "fgf_warp.integrator",
        "fgf_warp.scene",
    ),
    "fgf_warp.upload_meshes": ("fgf_warp.bvh", "fgf_warp.device", "fgf_warp.scene", "fgf_warp.upload_instances"),
    "fgf_warp.upload_shading": (
        "fgf_warp.device",
        "fgf_warp.scene",
        "fgf_warp.theory",
        "fgf_warp.upload_instances",
    ),
    "fgf_warp.upload_lights": (
        "fgf_warp.device",
        "fgf_warp.integrator",
        "fgf_warp.scene",
        "fgf_warp.upload_shading",
    ),
    "fgf_warp.probes": ("fgf_warp.device", "fgf_warp.theory", "fgf_warp.upload"),
    "fgf_warp.renderer": (
        "fgf_warp",
        "fgf_warp.bvh",
        "fgf_warp.errors",
        "fgf_warp.features",
        "fgf_warp.headers",
        "fgf_warp.integrator",
        "fgf_warp.locks",
        "fgf_warp.result",
        "fgf_warp.scene",
        "fgf_warp.settings",
        "fgf_warp.upload",
    ),
    "fgf_warp.convergence": (
        "fgf_warp.errors",
        "fgf_warp.renderer",
        "fgf_warp.result",
        "fgf_warp.scene",
        "fgf_warp.settings",
    ),
    "fgf_warp.finishing": (
        "fgf_warp.convergence",
        "fgf_warp.errors",
        "fgf_warp.output",
        "fgf_warp.renderer",
        "fgf_warp.result",
        "fgf_warp.scene",
        "fgf_warp.settings",
    ),
    "fgf_warp.output": ("fgf_warp", "fgf_warp.errors", "fgf_warp.result", "fgf_warp.settings"),
    "usd_scenes": ("fgf_warp.errors", "fgf_warp.scene"),
    "generators": ("fgf_warp", "usd_scenes"),
}
"""What each module or package may import of the project, beside itself."""

ORDERS = {
    "fgf_warp.scene": (
        "values",
        "placements",
        "checks",
        "boxes",
        "shells",
        "camera",
        "medium",
        "textures",
        "surface",
        "mesh",
        "shapes",
        "lights",
        "scene",
    ),
}
"""The files of a package, of which each imports only those before it."""

ONLY_IN = {
    "pxr": ("usd_scenes",),
    "OpenImageIO": ("fgf_warp.output", "usd_scenes.reader.images"),
    "colour": ("fgf_warp.output",),
    "pyoidn": ("fgf_warp.output",),
    "flip_evaluator": ("fgf_warp.output",),
    "warp": (
        "fgf_warp.device",
        "fgf_warp.bvh",
        "fgf_warp.bvh_kernel",
        "fgf_warp.bvh_splitting",
        "fgf_warp.headers",
        "fgf_warp.integrator",
        "fgf_warp.upload",
        "fgf_warp.upload_instances",
        "fgf_warp.upload_lights",
        "fgf_warp.upload_meshes",
        "fgf_warp.upload_shading",
        "fgf_warp.probes",
        "fgf_warp.renderer",
        "generators.commands.common",
    ),
}
"""Libraries behind a door."""


def is_in(module: str, packages) -> bool:
    return any(module == package or module.startswith(package + ".") for package in packages)


def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            for alias in node.names:
                inner = ROOT / Path(*node.module.split("."), alias.name)
                is_module = inner.is_dir() or inner.with_suffix(".py").exists()
                found.add(f"{node.module}.{alias.name}" if is_module else node.module)
    return found


SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))


def files_of(package: str) -> list[Path]:
    return sorted((ROOT / Path(*package.split("."))).glob("*.py"))


def module_name(path: Path) -> str:
    name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    return name.removesuffix(".__init__")


@pytest.mark.parametrize("path", SOURCES, ids=module_name)
def test_direction(path):
    module = module_name(path)
    owners = [owner for owner in ALLOWED if is_in(module, (owner,))]
    for name in imports(path):
        if is_in(name, PACKAGES) and owners:
            # `fgf_warp` itself, where it is allowed as a whole, is the package's version alone, but for generators.
            whole = [a for a in ALLOWED[owners[0]] if a != "fgf_warp" or module.startswith("generators")]
            allowed = is_in(name, (*whole, owners[0])) or (name == "fgf_warp" and "fgf_warp" in ALLOWED[owners[0]])
            assert allowed, f"{module} imports {name}"
        library = name.split(".")[0]
        if library in ONLY_IN:
            assert is_in(module, ONLY_IN[library]), f"{module} imports {library}"


def test_every_module_is_held():
    held = [module_name(path) for path in SOURCES if any(is_in(module_name(path), (owner,)) for owner in ALLOWED)]
    assert sorted({*held, "fgf_warp"}) == sorted({module_name(path) for path in SOURCES} | {"fgf_warp"})


@pytest.mark.parametrize("package", ORDERS)
def test_order_in_a_package(package):
    order = [f"{package}.{name}" for name in ORDERS[package]]
    assert sorted(order) == sorted(f"{package}.{path.stem}" for path in files_of(package) if path.stem != "__init__")
    for path in files_of(package):
        module = module_name(path)
        before = order[: order.index(module)] if module in order else order
        for name in imports(path):
            assert not is_in(name, (package,)) or name in before, f"{module} imports {name}"


@pytest.mark.parametrize(
    ("imported", "absent"),
    [
        ("fgf_warp", ("warp", "pxr", "OpenImageIO", "colour")),
        ("fgf_warp.scene", ("warp", "pxr", "OpenImageIO", "colour", "scipy")),
        ("fgf_warp.output.exr", ("warp", "pxr", "colour")),
        ("generators.cli", ("warp", "pxr", "OpenImageIO", "colour", "pyarrow")),
    ],
)
def test_imports_start_nothing(imported, absent):
    code = f"import sys, {imported}; print([m for m in {absent!r} if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """The modules that reach themselves by what they import: each group of those that reach one another, sorted."""
    reached = {module: set(names) for module, names in graph.items()}
    for middle in graph:
        for names in reached.values():
            if middle in names:
                names.update(reached[middle])
    groups = {tuple(sorted(n for n in reached[m] if m in reached[n])) for m in graph if m in reached[m]}
    return [list(group) for group in sorted(groups)]


def test_no_files_import_each_other():
    """Directly or in a circle, wherever in a file the import is written.

    An import inside a function, or for type checkers alone, breaks no import at run time, yet whoever reads one of the
    files must know the other, so both count. A package's `__init__` counts for those who import a name of its own, not
    for those who import a module below it.
    """
    files = {module_name(path): path for path in SOURCES}
    graph = {module: imports(path) & files.keys() for module, path in files.items()}
    assert not circles(graph)


def test_circles_are_found():
    graph = {"a": {"b"}, "b": {"c"}, "c": {"b", "e"}, "d": {"d"}, "e": set()}
    assert circles(graph) == [["b", "c"], ["d"]]
