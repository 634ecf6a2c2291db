"""What the configuration means: names and numbers derived from it. No numerics, no imports of them."""

import difflib
import glob
import hashlib
import itertools
import json
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from addvc.errors import ConfigError

AXES = {"x": 0, "y": 1, "z": 2}
NOMINAL_SIZES = [33, 23, 12]  # of the paper, for cells of 28 voxels
NOMINAL_CELL = 28.0
TIFF, ZARR = (".tif", ".tiff"), ".zarr"
"""Suffixes of slices, which a folder may hold, and of a folder that is a scan itself."""

WHOLE = (".nrrd", ".nhdr", ".mha", ".mhd", ".gz")
"""Suffixes of scans that are read as a whole, or may be, since they may be compressed."""

META_DATA, NRRD_DATA = r"^ElementDataFile\s*=\s*(.+?)\s*$", r"^data ?file\s*:\s*(.+?)\s*$"
HEADERS = {".mhd": META_DATA, ".mha": META_DATA, ".nhdr": NRRD_DATA, ".nrrd": NRRD_DATA}
"""Scans that may be of two files: how the header names the one with the voxels."""

HEADER_BYTES = 2**15
"""How far a header goes, at most."""

NETWORK = "-network"
"""Ending of the result that a network fit makes of a mesh."""

DEMO = "twin"  # the case that the default configuration has
TWIN_VOXEL_UM = 20.01  # the binned image of the paper: 3 x 6.67
TWIN_SIZES = {
    "tiny": (72, 84, 72),
    "default": (120, 140, 120),
    "mid": (200, 240, 200),
    "paper": (504, 551, 507),
}  # shape (nx, ny, nz) of the binned image of a twin, voxels
TWIN_POROSITY = 0.85  # at least
TWIN_CELL = 8.0  # voxels, at least
TWIN_STRAIN = 0.5  # nominal, at most
IMAGING = (  # keys of `twin` that change its scans, but neither foam nor motion
    "bin",
    "noise",
    "dtype",
    "psf",
    "partial_volume",
    "cupping",
    "rings",
    "drift",
)


def loading_axis(config: dict) -> int:
    """0, 1 or 2."""
    return AXES[config["loading_axis"]]


def case_kind(config: dict) -> str:
    """`twin`, `virtual` or `scans`: where images come from.

    Raises ConfigError when the configuration says more than one thing, or too little."""
    if "twin" in config and "scans" in config:
        raise ConfigError("the configuration has both `twin` and `scans`; keep one of them")
    if "virtual" in config and "scans" not in config:
        raise ConfigError("`virtual` deforms a real scan: give scans.reference too")
    if "truth" in config and ("scans" not in config or "virtual" in config):
        raise ConfigError(
            "`truth` is the displacement of your own scans: give scans, or leave truth out"
        )
    if "scans" not in config:
        if config.get("loading_axis", "y") != "y":
            raise ConfigError(
                f"loading_axis is {config['loading_axis']}, but the twin is compressed "
                "along y: leave loading_axis out"
            )
        return "twin"
    if "virtual" in config:
        if config["scans"].get("states"):
            raise ConfigError("`virtual` makes the deformed states: leave out scans.states")
        return "virtual"
    return "scans"


def twin_faults(options: dict) -> Iterator[str]:
    """What keeps a twin of these options from being made; what is left out is right."""
    strains = options.get("strains", [])
    if any(later <= earlier for earlier, later in itertools.pairwise((0, *strains))):
        yield f"twin.strains is {list(strains)}; they must increase from above 0"
    if max(strains, default=0) > TWIN_STRAIN:
        yield f"twin.strains is {list(strains)}; at most {TWIN_STRAIN:g} is possible"
    porosity = options.get("porosity", TWIN_POROSITY)
    if not TWIN_POROSITY <= porosity < 1:
        yield (
            f"`porosity` is {porosity:g}; a twin has at least {TWIN_POROSITY:g} and less than 1, "
            "outside of that struts merge or vanish: try 0.9 to 0.98"
        )
    size, cell = options.get("size", "default"), options.get("cell_size", NOMINAL_CELL)
    most = min(TWIN_SIZES[size]) / 2
    if not TWIN_CELL <= cell <= most:
        yield (
            f"twin.cell_size is {cell:g}; {TWIN_CELL:g} to {most:g} voxels are possible with size "
            f"{size}, none outside of that"
        )


def twin_parts(config: dict) -> tuple[dict, dict]:
    """Options of the twin: those of its foam and motion, and all of them."""
    whole = config["twin"] | {"porosity": config["porosity"]}
    return {key: value for key, value in whole.items() if key not in IMAGING}, whole


def twin_folder(options: dict) -> str:
    """Where a twin is kept: by its options, so that cases that differ in how they measure share it.

    The name begins with a dot, as no case may."""
    text = json.dumps(options, sort_keys=True)
    key = hashlib.sha256(text.encode()).hexdigest()[:10]
    return f"results/.twins/{options['size']}-{options['seed']}-{key}"


def truth_file(config: dict) -> str | None:
    """The user's own truth, None where there is none; ConfigError when it is not there."""
    path = config.get("truth")
    path = None if path is None else os.path.expanduser(path)
    if path is not None and not Path(path).is_file():
        raise ConfigError(
            f"truth {path} was not found; paths start at {Path.cwd()}: correct or leave out `truth`"
        )
    return path


def state_strains(config: dict) -> list[float | None]:
    """Nominal strain of each loading state, None where it is not known (real scans)."""
    kind = case_kind(config)
    if kind == "scans":
        return [None] * len(config["scans"]["states"])
    return list(config[kind]["strains"])


def state_labels(config: dict) -> dict[int, str]:
    """What figures call each state: its nominal strain, with as many digits as tell them apart, or its
    number."""
    strains = dict(enumerate(state_strains(config), start=1))
    for digits in range(1, 6):
        labels = {
            n: f"state {n}" if strain is None else f"{100 * strain:.{digits}f} %"
            for n, strain in strains.items()
        }
        if len(set(labels.values())) == len(labels):
            return labels
    return {n: f"state {n}" for n in strains}


def meso_names(config: dict) -> list[str]:
    """`meso33`, `meso23`, `meso12`: from coarse to fine.

    Raises ConfigError where meso.sizes do not fall, or one is given twice."""
    sizes = config["meso"].get("sizes", NOMINAL_SIZES)
    names = [f"meso{size:g}" for size in sizes]
    if sorted(sizes, reverse=True) != list(sizes) or len(set(names)) != len(names):
        raise ConfigError(
            f"meso.sizes {sizes} must fall from coarse to fine, and differ in six digits"
        )
    return names


def network_names(config: dict) -> list[str]:
    """`meso12-network`, the finest meso result near equilibrium of the frame of struts, where it is
    asked for; none of virtual tests, whose waves are in no equilibrium."""
    wanted = config["meso"]["network"] and case_kind(config) != "virtual"
    return [meso_names(config)[-1] + NETWORK] if wanted else []


def mesh_name(result: str) -> str:
    """The mesh of a result: every micro method shares one, and a network fit has that of meso DVC."""
    return result.split("-")[0]


def meso_size(config: dict, name: str, cell_size: float) -> float:
    """Mean edge of a meso mesh in voxels: as given, or the paper's times cell size / 28."""
    size = float(name.removeprefix("meso"))
    return size if "sizes" in config["meso"] else size * cell_size / NOMINAL_CELL


@dataclass(frozen=True)
class Method:
    """What a method of micro DVC has: the shell in its quadrature, a frame that turns, robust weights,
    the choice of l_E; or, the paper's, the equilibrium gap of Eq. 10 in place of the elastic energy."""

    shell: bool = True
    rotation: bool = True
    robust: bool = True
    choice: bool = True
    gap: bool = False


METHODS = {
    "corotational": Method(),
    "without_shell": Method(shell=False),
    "without_rotation": Method(rotation=False),
    "without_robust": Method(robust=False),
    "without_choice": Method(choice=False),
    "eq10": Method(shell=False, rotation=False, robust=False, choice=False, gap=True),
}


def chooses(section: dict, method: str) -> bool:
    """Whether the images choose l_E for a method; section: `micro`."""
    given = section["l_e"] != "auto" or "l_e" in section.get("times", {})
    return not given and section["stages"] > 1 and METHODS[method].choice


def micro_names(config: dict) -> dict[str, str]:
    """Result name -> method of micro DVC; `micro` is the first method of micro.methods."""
    first, *others = config["micro"]["methods"]
    return {"micro": first} | {f"micro-{method}": method for method in others}


def scan_settings(config: dict, state: int) -> dict:
    """How to read the scan of a state: `format` (of ScanFormat), `bin`, `crop`.

    Scans made by the workflow itself (twin, virtual states) are TIFF pages in z, y, x order."""
    kind = case_kind(config)
    if kind == "twin":
        return {"format": {"axes": "zyx"}, "bin": config["twin"]["bin"], "crop": None}
    scans = config["scans"]
    if kind == "virtual" and state > 0:
        return {"format": {"axes": "zyx"}, "bin": scans["bin"], "crop": None}
    keys = ("axes", "shape", "dtype", "byte_order", "header_bytes", "dataset")
    return {
        "format": {key: scans[key] for key in keys if key in scans},
        "bin": scans["bin"],
        "crop": scans["crop"],
    }


def voxel_size_um(config: dict) -> float:
    """Edge of a voxel of the scans, before binning, micrometres: for units only."""
    if case_kind(config) == "twin":
        return TWIN_VOXEL_UM / config["twin"]["bin"]
    return config["scans"]["voxel_size_um"]


def scan_paths(config: dict) -> list[str]:
    """The scans of the user's own: the reference, then the states, ~ being the home folder."""
    if "scans" not in config:
        return []
    paths = [config["scans"]["reference"], *config["scans"]["states"]]
    return [os.path.expanduser(path) for path in paths]


def voxel_file(path: Path) -> Path:
    """The file that has the voxels of a scan: itself, or the one that its header names.

    Raises ConfigError when it is not there, or there are several."""
    pattern = HEADERS.get(path.suffix.lower())
    if pattern is None:
        return path
    with path.open("rb") as file:
        header = file.read(HEADER_BYTES).partition(b"\n\n")[0].decode("latin-1")
    named = re.search(pattern, header, re.IGNORECASE | re.MULTILINE)
    if named is None or named[1].upper() == "LOCAL":
        return path
    if re.match(r"LIST\b|.*%", named[1]):
        raise ConfigError(
            f"{path} has its voxels in several files ({named[1]}), 1 is needed: save it as one file"
        )
    data = path.parent / named[1]
    if not data.is_file():
        raise ConfigError(f"{path} names {named[1]}, which was not found beside it: copy it there")
    return data


def scan_files(path: str) -> list[str]:
    """The files of a scan: itself and what holds its voxels, those of a folder, or of a pattern.

    Raises ConfigError when there is none."""
    place = Path(path)
    if place.is_file():
        try:
            return list(dict.fromkeys((path, str(voxel_file(place)))))
        except OSError as error:
            raise ConfigError(
                f"{path} cannot be read ({error.strerror}): make it readable"
            ) from error
    everything = place.suffix == ZARR
    slices = [
        file
        for file in (place.rglob("*") if everything else place.glob("[!.]*"))
        if file.is_file() and (everything or file.suffix.lower() in TIFF)
    ]
    found = sorted(map(str, slices)) if place.is_dir() else sorted(glob.glob(path))
    if place.is_dir() and not found:
        raise ConfigError(
            f"scan {path} is a folder without TIFF slices (0; at least 1): name the file"
        )
    if not found:
        hint = "curly quotes around it? " if re.search("[\u2018-\u201f]", path) else ""
        beside = [str(file) for file in place.parent.glob("*")] if place.parent.is_dir() else []
        near = difflib.get_close_matches(path, beside, 1, 0.8)
        hint += f"did you mean {near[0]}? " if near else ""
        raise ConfigError(
            f"scan {path} was not found (0 files; at least 1); {hint}paths start at {Path.cwd()}: "
            "correct scans.reference or scans.states"
        )
    return found
