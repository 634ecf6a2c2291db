"""How figures look: sizes, fonts, colours, ranges, bars, and how they are written."""

import re
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, FuncNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation

from addvc.images.files import atomic_path

INCH = 1 / 25.4
WIDTH, HEIGHT = 170.0, 232.0  # mm, the text of a page
DPI = 300
MAGNITUDE, SIGNED = "viridis", "RdBu_r"
SOLID, BLUE, RED, ORANGE, DARK = "#c6ccd3", "#3d86cf", "#c8341f", "#e08214", "#303438"
DOUBT = "#d10f9b"  # what is not to be trusted, in maps of any colours
SERIES = ("#440154", "#31688e", "#35b779", "#e6a000", "#c51b7d", "#7f7f7f")
MARKERS = "osD^vP"
OTHERS = (
    "#5c3a10",
    "#a0762a",
    "#762a83",
    "#1b7837",
    "#7f7f7f",
)  # results but finest meso and micro
AXES = "xyz"
Colour = str | tuple[float, float, float, float]

ARROW = 14.0  # length of the arrows along the axes, points
ARROWHEAD = {"arrowstyle": "<|-", "lw": 1, "color": "k", "shrinkA": 0, "shrinkB": 0}
LONG, NARROW = 28, 14  # characters: of a title that takes two lines, of a line below a tick

plt.rcParams.update(
    {
        "font.size": 8.5,
        "axes.titlesize": 9,
        "axes.labelsize": 8.5,
        "legend.fontsize": 8,
        "xtick.labelsize": 8,
        "ytick.labelsize": 8,
        "figure.titlesize": 9.5,
        "axes.linewidth": 0.7,
        "lines.linewidth": 1.4,
        "legend.frameon": False,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "savefig.dpi": DPI,
        "svg.hashsalt": "addvc",
        "image.interpolation": "antialiased",
    }
)


def figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure of a size in millimetres."""
    return plt.figure(figsize=(width * INCH, height * INCH), layout="constrained")


def panels(rows: int, columns: int, aspect: float, spare: float = 12.0, bar: float = 0.0,
           below: float = 0.0) -> tuple[Figure, np.ndarray]:  # fmt: skip
    """A figure of pictures of one aspect (height / width), axes (rows, columns), no larger than a
    page. Millimetres: `spare` above and below each row for words, `bar` at its right, `below` the
    last row."""
    width = (WIDTH - bar - 4) / columns - 3
    width = min(width, ((HEIGHT - below) / rows - spare) / aspect)
    fig = figure(rows * (aspect * width + spare) + below, columns * (width + 3) + bar + 4)
    return fig, fig.subplots(rows, columns, squeeze=False)


def rows_of_pictures(
    aspects: list[float], columns: int, spare: float = 12.0
) -> tuple[Figure, np.ndarray]:
    """The same for rows whose pictures are as wide, but of different aspects."""
    width = (WIDTH - 4) / columns - 3
    width = min(width, (HEIGHT - len(aspects) * spare) / sum(aspects))
    heights = [aspect * width + spare for aspect in aspects]
    fig = figure(sum(heights), columns * (width + 3) + 4)
    return fig, fig.subplots(len(aspects), columns, squeeze=False, height_ratios=heights)


def series(count: int) -> list[Colour]:
    """Colours of curves in an order, `count` of them."""
    if count <= len(SERIES):
        return list(SERIES[:count])
    return [plt.get_cmap(MAGNITUDE)(share) for share in np.linspace(0, 0.95, count)]


def signed(value: float, digits: int = 2) -> str:
    """A number with a true minus sign."""
    return f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}")


def letter(number: int) -> str:
    """(a), (b), ... (z), (aa), ... for 0, 1, ..."""
    more, last = divmod(number, 26)
    return f"({chr(ord('a') + more - 1) if more else ''}{chr(ord('a') + last)})"


def headline(ax: Axes, text: str, number: int | None = None) -> None:
    """Title of a panel with its letter, a long one in two lines; in red when it tells of a failure."""
    lead = "" if number is None else f"{letter(number)} "
    wrong, text = is_wrong(text), two_lines(lead + text)
    size = 7.5 if "\n" in text else 8 if wrong else None
    ax.set_title(text, loc="left", color=RED if wrong else "black", fontsize=size)


def is_wrong(text: str) -> bool:
    """Whether words about a result tell of a failure."""
    return "failed" in text or "not converged" in text


def two_lines(text: str) -> str:
    """A long text broken before what it says of a result."""
    if len(text) <= LONG:
        return text
    return re.sub(r": (?=(not )?converged|failed)", ":\n", text, count=1)


def narrow(text: str) -> str:
    """The title of a state as lines of a word or two, for a tick."""
    label, _, words = text.partition(": ")
    parts = words.replace(", ", ",\n").splitlines()
    return "\n".join([label, *(line for part in parts for line in textwrap.wrap(part, NARROW))])


def robust_range(
    values: Iterable[np.ndarray], signed: bool = False, share: float = 0.5
) -> Normalize:
    """Range of all values but `share` percent at either end; symmetric about 0 if `signed`."""
    flat = np.concatenate([np.ravel(v)[np.isfinite(np.ravel(v))] for v in values])
    low, high = np.percentile(flat, (share, 100 - share))
    if signed:
        low, high = -max(abs(low), abs(high)), max(abs(low), abs(high))
    if high - low < 1e-9:
        low, high = low - 0.5e-3, high + 0.5e-3
    return Normalize(float(low), float(high))


def component_range(values: list[np.ndarray], root: bool = False) -> tuple[Normalize, str]:
    """Range and map of a displacement component: diverging about 0 when both signs matter.

    `root`: colours follow the square root, so that small states show beside large ones."""
    norm = robust_range(values)
    span = norm.vmax - norm.vmin
    both = norm.vmin < -0.15 * span and norm.vmax > 0.15 * span
    norm = robust_range(values, signed=True) if both else norm
    norm = root_range(norm.vmin, norm.vmax) if root else norm
    return norm, SIGNED if both else MAGNITUDE if norm.vmin > -0.15 * span else f"{MAGNITUDE}_r"


def root_range(low: float, high: float) -> Normalize:
    """A range whose colours follow the square root: much of the map for small values."""
    return FuncNorm((_root, _square), low, high)


def _root(x: np.ndarray) -> np.ndarray:
    return np.sign(x) * np.sqrt(np.abs(x))


def _square(x: np.ndarray) -> np.ndarray:
    return np.sign(x) * np.square(x)


def colour_bar(
    fig: Figure, axes, norm: Normalize, cmap: str | Colormap, label: str, **options
) -> None:
    """A colour bar, its ends pointed unless `extend` says otherwise, since ranges are robust; a root
    scale is named; its width is left to the layout."""
    mappable = ScalarMappable(norm, cmap)
    bar = fig.colorbar(mappable, ax=axes, extendfrac=0.03, **({"extend": "both"} | options))
    bar.set_label(f"{label}\nroot scale" if isinstance(norm, FuncNorm) else label)
    bar.ax.tick_params(length=2.5, width=0.6)
    bar.outline.set_linewidth(0.5)


def voxels(voxel_um: float) -> str:
    """The unit of lengths, with its size."""
    return (
        f"voxels of {voxel_um:.3g} µm"
        if voxel_um < 999.5
        else f"voxels of {voxel_um / 1000:.3g} mm"
    )


def nice_length(reach: float) -> float:
    """The largest of 1, 2, 5, 10, ... that is at most `reach`."""
    power = 10 ** np.floor(np.log10(reach))
    return float(power * max(m for m in (1, 2, 5) if m * power <= reach * (1 + 1e-9)))


def note(ax: Axes, text: str, x: float = 0.5, y: float = 0.0, **options) -> None:
    """Words below a panel, at a share of its width and height."""
    options = {"ha": "center", "va": "top"} | options
    ax.text(x, y, text, transform=ax.transAxes, **options)


def row_name(ax: Axes, name: str) -> None:
    """The name of a row, upright at the left of its first panel."""
    note(ax, name, -0.03, 0.5, rotation=90, ha="right", va="center", fontsize=9)


def axis_arrows(ax: Axes, right: np.ndarray, up: np.ndarray, y: float = -0.025) -> None:
    """Arrows along x, y and z as they point in a picture with the directions `right` (3,) and `up` (3,),
    below its right end at `y` over its height, its highest name too; none for an axis that points at the
    viewer."""
    depth = max(1.2, 1.5 * np.max(up) + 0.4) * ARROW / 72
    below = ax.transAxes + ScaledTranslation(0, -depth, ax.figure.dpi_scale_trans)
    for name, *along in zip(AXES, right, up, strict=True):
        if np.hypot(*along) < 0.35:
            continue
        for text, length, arrow in (("", ARROW, ARROWHEAD), (name, 1.5 * ARROW, None)):
            tip = length * np.array(along)
            ax.annotate(
                text, (0.9, y), tip, below, "offset points", arrow,
                annotation_clip=False, ha="center", va="center", fontsize=8,
            )  # fmt: skip


def scale_bar(ax: Axes, voxel_um: float, share: float = 0.3, y: float = -0.025) -> None:
    """A bar below the picture, about `share` of its width, with its length in both units; `y`: where,
    over the height of the picture."""
    left, right = sorted(ax.get_xlim())
    length = nice_length(share * (right - left))
    micro = length * voxel_um
    size = f"{micro / 1000:.3g} mm" if micro >= 1000 else f"{micro:.3g} µm"
    end, where = length / (right - left), {"transform": ax.transAxes, "clip_on": False}
    ax.plot([0, end], [y, y], "k", lw=2, solid_capstyle="butt", **where)
    note(ax, f"{length:g} voxels = {size}", 0, y - 0.015, ha="left", fontsize=8)


def save(fig: Figure, outputs: Iterable[str | Path]) -> None:
    """Write to each name (PNG or SVG), the same bytes for the same data, and close the figure."""
    for name in outputs:
        vector = Path(name).suffix == ".svg"
        with atomic_path(name) as temporary:
            fig.savefig(
                temporary,
                bbox_inches="tight",  # pictures of a fixed aspect may push words over the border
                pad_inches=0.02,
                metadata={"Date": None} if vector else {"Software": None},
            )
    plt.close(fig)


def looks(meso: Sequence[str], micro: Sequence[str], more: Sequence[str] = ()) -> dict:
    """Colour and marker of each result by name, the same in all figures: `micro` is blue, the finest
    meso mesh orange, as where there are only these two."""
    names = list(dict.fromkeys([*meso, *micro, *more]))
    known = {micro[0]: BLUE, meso[-1]: ORANGE}
    rest = dict(zip((n for n in names if n not in known), OTHERS * len(names), strict=False))
    return {
        name: {"color": (known | rest)[name], "marker": MARKERS[number % len(MARKERS)]}
        for number, name in enumerate(names)
    }


def line(colour: str, label: str, ls: str = "-", marker: str = "") -> Line2D:
    """An entry of a legend."""
    return Line2D([], [], color=colour, label=label, ls=ls, marker=marker, ms=5, mew=1.5)
