"""What does not go together in a configuration, or is out of what a foam can be."""

import math

from addvc import config as settings
from addvc.errors import ConfigError

LEAST_POROSITY = 0.3
"""Solids with less void have no struts to look for."""


def pair_faults(config: dict, told: bool = False) -> list[str]:
    """What does not go together in a configuration whose values are each right; where some are not, and
    `told`, as far as it can be said."""
    faults = []
    checks = (
        settings.case_kind,
        check_own_case,
        check_twin,
        check_porosity,
        check_region,
        check_finite,
        check_platens,
        check_crop,
        settings.truth_file,
        lambda config: settings.meso_names({"meso": {}} | config),
    )
    for check in checks:
        try:
            check(config)
        except ConfigError as error:
            faults.append(str(error))
        except (TypeError, LookupError, AttributeError, ValueError):  # of a value that is told
            if not told:
                raise
    return list(dict.fromkeys(faults))


def check_own_case(config: dict) -> None:
    """ConfigError where real scans would go to the folder of the demonstration."""
    if "scans" in config and config.get("case", settings.DEMO) == settings.DEMO:
        fault = (
            f"{settings.DEMO}, whose folder is the demonstration's"
            if "case" in config
            else "missing"
        )
        raise ConfigError(
            f"`case` is {fault}: give your scans a case of their own, such as `case: mine` "
            "(results go to results/mine)"
        )


def check_twin(config: dict) -> None:
    """ConfigError where a twin has no struts to make: strains that do not grow, too dense a foam, cells
    too large for its image."""
    if settings.case_kind(config) != "twin":
        return
    given = {key: config[key] for key in ("porosity",) if key in config} | config.get("twin", {})
    for fault in settings.twin_faults(given):
        raise ConfigError(fault)


def check_porosity(config: dict) -> None:
    """ConfigError where real scans come without their porosity, or with that of hardly a foam."""
    if "scans" not in config:
        return
    if "porosity" not in config:
        raise ConfigError(
            "`porosity` is missing: give the share of void of your material, which sets the threshold"
        )
    share = config["porosity"]
    if share < LEAST_POROSITY:
        raise ConfigError(
            f"`porosity` is {share:g}; at least {LEAST_POROSITY:g} is expected of a material of struts: "
            f"it is the share of void, not of solid (did you mean {1 - share:g}?)"
        )


def check_region(config: dict) -> None:
    """ConfigError where a slab of `micro.region` ends before it begins, or is given and to be found."""
    region = config.get("micro", {}).get("region", "all")
    wanted = {} if region == "all" else region
    low, high = wanted.get("low"), wanted.get("high")
    if low is not None and high is not None and low >= high:
        raise ConfigError(
            f"micro.region goes from low = {low:g} to high = {high:g}; low must be below high: swap them"
        )
    if "height" in wanted and {"low", "high"} & set(wanted):
        raise ConfigError(
            "micro.region has a height, whose place meso DVC finds, and low or high, which give one; "
            "leave out either"
        )
    kind = settings.case_kind(config)
    states = (config.get(kind) or {}).get("states" if kind == "scans" else "strains")
    if "height" in wanted and states == []:  # not given, those of the schema are
        raise ConfigError(
            "micro.region has a height, whose place the residual of meso DVC finds, and there are 0 "
            "loading states (at least 1); add scans.states, or give low and high"
        )


def check_finite(config: dict, path: str = "") -> None:
    """ConfigError for nan and infinity, in lists too, which pass every limit."""
    for key, value in config.items():
        if isinstance(value, dict):
            check_finite(value, f"{path}{key}.")
        elif isinstance(value, list):
            check_finite(dict(enumerate(value)), f"{path}{key}.")
        elif isinstance(value, float) and not math.isfinite(value):
            raise ConfigError(f"`{path}{key}` is {value}; give a finite number")


def check_crop(config: dict) -> None:
    """ConfigError where a part of `scans.crop` ends before it begins."""
    for name, pair in zip("xyz", config.get("scans", {}).get("crop") or [], strict=False):
        if pair is not None and pair[0] >= pair[1]:
            raise ConfigError(
                f"scans.crop of {name} is {pair[0]} to {pair[1]}; use START < STOP, voxels of the scan"
            )


def check_platens(config: dict) -> None:
    """ConfigError where platens are reversed, or a start needs some where there are none."""
    platens = config.get("scans", {}).get("platens")
    if isinstance(platens, list) and platens[0] >= platens[1]:
        raise ConfigError(
            f"scans.platens is {platens}; give [LOW, HIGH], the lower coordinate along the loading axis "
            "first"
        )
    if platens != "none":
        return
    if "extrapolated" in config.get("meso", {}).get("candidates", []):
        raise ConfigError(
            "scans.platens is none, and `extrapolated` needs the motion of the platens: leave it out of "
            "meso.candidates, or give platens: auto"
        )
