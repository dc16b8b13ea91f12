"""Settings of the node of studies; its ROS parameters derive from them."""

from __future__ import annotations

from dataclasses import dataclass

from ir_values.settings import check_settings, setting


@dataclass(frozen=True)
class StudiesSettings:
    """Settings of the node of studies. An empty text in a list counts as nothing: ROS has no empty
    lists.
    """

    output: str = setting(
        "out/studies", "Folder below which studies write; a relative one counts from the working "
"folder.",
        read_only=True,
    )  # fmt: skip
    roots: tuple[str, ...] = setting(
        ("",),
        "Folders below which cell files may be read; empty: IR_FILE_ROOTS, else the working "
        "folder.",
        read_only=True,
    )
    workers: int = setting(
        0, "Processes of a study; 0: one per core.", minimum=0, maximum=64, read_only=True
    )
    scheduler: str = setting(
        "", "Address of a Dask cluster that makes the jobs instead; empty: none.", read_only=True
    )

    def __post_init__(self) -> None:
        check_settings(self)
