from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "ir_description"


def data_files() -> list[str]:
    """Everything under data/, relative to the package: robots, power modes, cells and their
    meshes.
    """
    root = Path(__file__).parent / PACKAGE
    return sorted(
        str(path.relative_to(root)) for path in (root / "data").rglob("*") if path.is_file()
    )


setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed", *data_files()]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools", "numpy", "scipy", "PyYAML"],
    extras_require={
        "cad": ["trimesh", "networkx", "coacd", "fast-simplification"],
        "step": ["trimesh", "networkx", "coacd", "cascadio"],
        "xacro": ["xacro"],
    },
    zip_safe=False,
    maintainer="The ir maintainers",
    maintainer_email="maintainers@example.org",
    description="The robot and the cells as data: limits, drives, power modes, cells, validated "
    "loading.",
    license="Apache-2.0",
    python_requires=">=3.11",
)
