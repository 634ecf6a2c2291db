"""Ablation and sensitivity of micro DVC: what is varied, and what of each variant is its own.

A variant is one change to the configuration: another method (study `ablation`), or one value times a
factor (study `sensitivity`). It has files of its own from the first stage on that the change touches;
before that it shares those of the case. No numerics, no imports of them."""

from dataclasses import dataclass

from addvc.config import METHODS, micro_names
from addvc.errors import ConfigError

EQ10 = ("l_k", "l_l")
"""Parameters of the paper's method."""

PARAMETERS = (*EQ10, "l_e", "nu", "threshold", "size")
LENGTHS = (*EQ10, "l_e")

MOST_NU = 0.45
"""Of the schema: near 1/2 linear tetrahedra lock."""

FILES = {
    "threshold": "geometry/threshold.json",
    "solid": "geometry/solid.h5",
    "region": "geometry/region.json",
    "bridges": "geometry/bridges.json",
    "surface": "geometry/surface.vtu",
    "mesh": "geometry/micro_mesh.vtu",
    "figures": "geometry/micro.json",
    "classes": "geometry/micro.vtu",
    "shell": "geometry/shell.h5",
    "start": "dvc/micro_start_state{state}.h5",
    "factor": "dvc/factor.h5",
    "solution": "dvc/micro_state{state}.h5",
    "residual": "analysis/residual_state{state}.h5",
    "statistics": "analysis/residual_state{state}.json",
    "error": "analysis/error_state{state}.json",
}
"""Files in the folder of a case or of a variant, in the order in which they are made."""

MAIN = {
    "solution": "dvc/{result}_state{state}.h5",
    "residual": "analysis/residual_{result}_state{state}.h5",
    "statistics": "analysis/residual_{result}_state{state}.json",
    "error": "analysis/error_{result}_state{state}.json",
}
"""Files of the main run for one of its results."""

FIRST = {"threshold": "threshold", "size": "solid"}
"""The first of FILES that a parameter touches (bridges are as thick as the lattice needs them); others
touch the factor only."""


@dataclass(frozen=True)
class Variant:
    """One change: `parameter` "method" or one of PARAMETERS, times `factor`; by which method."""

    parameter: str
    factor: float
    method: str

    @property
    def name(self) -> str:
        """Of its folder."""
        return self.method if self.parameter == "method" else f"{self.parameter}-{self.factor:g}"

    @property
    def study(self) -> str:
        return "ablation" if self.parameter == "method" else "sensitivity"

    def owns(self, file: str) -> bool:
        """Whether one of FILES is this variant's own, where it is not a result of the main run."""
        first = FIRST.get(self.parameter, "factor") if self.factor != 1 else "factor"
        order = list(FILES)
        return order.index(file) >= order.index(first)

    def path(self, file: str, root: str, config: dict, state: str = "") -> str:
        """One of FILES: the variant's own, or that of the case (`root`) where it is the same."""
        result = self.result(config)
        if file in MAIN and result is not None:
            return f"{root}/{MAIN[file]}".format(result=result, state=state)
        folder = f"{root}/{self.study}/{self.name}" if self.owns(file) else root
        return f"{folder}/{FILES[file]}".format(state=state)

    def section(self, micro: dict) -> dict:
        """The `micro` section under this change; lengths may be "auto", hence `times`."""
        if self.parameter in LENGTHS and self.factor != 1:
            return micro | {"times": {self.parameter: self.factor}}
        return micro | {"nu": micro["nu"] * self.factor} if self.parameter == "nu" else micro

    def mesh(self, mesh: dict) -> dict:
        """The `mesh` section under this change."""
        return mesh | {"size": mesh["size"] * (self.factor if self.parameter == "size" else 1)}

    def result(self, config: dict) -> str | None:
        """The result of the main run that is the same thing, None where there is none."""
        same = (name for name, method in micro_names(config).items() if method == self.method)
        return next(same, None) if self.factor == 1 else None


def ablation() -> list[Variant]:
    """The default method, the same less each of its ingredients, and the paper's."""
    return [Variant("method", 1, method) for method in METHODS]


def sensitivity(config: dict) -> list[Variant]:
    """A variant for each factor of each parameter in the `sensitivity` section, 1 always with them.

    Factors that lead Poisson's ratio out of its range are left out."""
    section, default = config["sensitivity"], config["micro"]["methods"][0]
    method = {name: "eq10" for name in EQ10} | {"l_e": "corotational"}
    found = (
        Variant(parameter, factor, method.get(parameter, default))
        for parameter in PARAMETERS
        if section[parameter]
        for factor in sorted({1, *section[parameter]})
    )
    return [variant for variant in found if variant.section(config["micro"])["nu"] <= MOST_NU]


def studied_state(config: dict, states: list[int]) -> int:
    """The loading state of the sensitivity study; ConfigError when there is no such state."""
    wanted = config["sensitivity"]["state"]
    if wanted == "auto":
        return states[min(3, len(states)) - 1]
    if wanted not in states:
        raise ConfigError(
            f"sensitivity.state is {wanted}, but there are {len(states)} loading states: lower it"
        )
    return wanted
