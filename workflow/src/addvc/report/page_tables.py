"""Tables of the first page of the report, in reStructuredText."""

from addvc.config import NETWORK, mesh_name
from addvc.correlation.frame_fit import SETTLED
from addvc.errors import grey_words


def figure(value: float | None, form: str) -> str:
    """A number in a format, or "unknown": a state that left the image has no residual."""
    return "unknown" if value is None else format(value, form)


def micro_name(summary: dict) -> str:
    """The default micro method: the first of them."""
    return next(mesh for mesh in summary["meshes"] if mesh.startswith("micro"))


def network_name(summary: dict) -> str | None:
    """The result of the network fit; None where it was not asked for."""
    return next((name for name in summary["results"] if name.endswith(NETWORK)), None)


def list_table(header: list[str], rows: list[list[str]]) -> list[str]:
    """A table in reStructuredText; "None." in place of one without rows."""
    if not rows:
        return ["", "None.", ""]
    lines = ["", ".. list-table::", "   :header-rows: 1", ""]
    for row in [header, *rows]:
        lines += [("   * - " if n == 0 else "     - ") + str(cell) for n, cell in enumerate(row)]
    return [*lines, ""]


RESIDUAL_WORDS = (
    "sigma(r): standard deviation of the residual at the Gauss points of the micro mesh (inside the "
    "struts, weighted by volume), for every mesh. Noise alone: what the noise of both images would "
    "leave there under the true displacement, as their voids differ. Far above it something is not "
    "followed; somewhat below it is normal for micro DVC, whose many unknowns follow part of the noise."
)


def network_words(summary: dict) -> list[str]:
    """Lines: what the result of the network fit is, and why it is a copy of that of its mesh in some
    states; none where it was not asked for."""
    name = network_name(summary)
    if name is None or not summary["states"]:
        return []
    words = (
        f"{name}: {mesh_name(name)} near equilibrium of the frame of struts, by as much as the "
        "images say that it helps; with less noise in it, it may leave more of the residual."
    )
    same = [
        f"- {state['label']}: a copy, since {state[name]['refused']}."
        for state in summary["states"]
        if state[name]["refused"]
    ]
    return ["", words, "", *same]


def results_table(summary: dict) -> list[str]:
    """sigma(r) on the micro quadrature beside that of noise alone and, with a truth, the error at bulk
    nodes."""
    known = any(state[mesh]["error"] for state in summary["states"] for mesh in summary["meshes"])
    header = ["state", "mesh", "sigma(r), grey levels", "noise alone, grey levels"]
    header += ["error median, voxel", "error p95, voxel", "error rms, voxel"] if known else []
    rows = []
    for state in summary["states"]:
        for mesh in summary["results"]:
            error = state[mesh]["error"] or {}
            sigma = state[mesh]["residual_std"], state.get("noise_std")
            row = [state["label"], mesh, *(grey_words(value, 3) for value in sigma)]
            lengths = (error[key] for key in ("median", "p95", "rms") if error)
            rows.append(row + [figure(length, ".3f") for length in lengths])
    return list_table(header, rows)


def convergence_table(summary: dict) -> list[str]:
    """Start, cut-off length, iterations and last step of every state and mesh."""
    rows = [
        [
            state["label"],
            start(state, mesh),
            mesh,
            cutoff(state[mesh]),
            str(state[mesh]["iterations"]),
            figure(state[mesh]["last_step"], ".1e"),
            "yes" if state[mesh]["converged"] else "NO",
        ]
        for state in summary["states"]
        for mesh in summary["results"]
    ]
    header = ["state", "start", "mesh", "l_E, l_L (voxel) or w", "iterations"]
    return list_table([*header, "last rms(du), voxel", "converged"], rows)


def start(state: dict, mesh: str) -> str:
    """What a result starts from: the network fit from that of its mesh."""
    if mesh.startswith("micro"):
        return state["micro_start"]
    return state[mesh]["start"] or mesh_name(mesh)


def convergence_words(summary: dict) -> str:
    """What the lengths of the table are not."""
    words = "The coarsest mesh has no regularisation"
    if network_name(summary):
        words += f"; w is the weight of equilibrium, whose fit ends at steps of {SETTLED:g} voxel"
    if "eq10" in summary["methods"].values():
        words += "; the lengths of eq10, which every state shares, are in Table 2"
    return words + "."


def cutoff(result: dict) -> str:
    """l_E of a micro result of the default kind, l_L of a meso one, w of a network fit."""
    if result["refused"]:
        return "a copy"
    if result["weight"]:
        return f"w = {result['weight']:.1e}"
    length = result["l_e"] or result["l_l"]
    return f"{length:.3g}" if length else "–"


def meshes_table(summary: dict) -> list[str]:
    """Size, quality and ultimate error of each mesh."""
    rows = [
        [
            name,
            str(m["nodes"]),
            str(m["cells"]),
            f"{m['mean_edge']:.2f}",
            f"{m['mean_volume']:.3g}",
            f"{m['min_dihedral']:.1f}",
            f"{m['ultimate_error']:.2e}" + ("" if m["ultimate_converged"] else " (not converged)"),
        ]
        for name, m in summary["meshes"].items()
    ]
    return list_table(
        [
            "mesh",
            "nodes",
            "cells",
            "mean edge, voxel",
            "mean volume, voxel^3",
            "least dihedral angle, degrees",
            "ultimate error (rigid shift: a lower bound), voxel",
        ],
        rows,
    )


def cost_table(cost: dict) -> list[str]:
    """CPU time, wall time and peak memory of each rule, the dearest first."""
    rows = [
        [rule, str(c["jobs"]), f"{c['cpu_s']:.0f}", f"{c['wall_s']:.0f}", f"{c['max_rss_mb']:.0f}"]
        for rule, c in sorted(cost.items(), key=lambda item: -item[1]["cpu_s"])
    ]
    return list_table(["rule", "jobs", "CPU, s", "wall, s", "peak memory, MB"], rows)


def scans_table(scans: dict) -> list[str]:
    """The input files, the reference first."""
    rows = [
        [
            str(n or "reference"),
            f"``{row['path']}``",
            " x ".join(map(str, row["shape"])),
            row["dtype"],
        ]
        for n, row in enumerate(scans["scans"])
    ]
    return list_table(["state", "file", "shape, voxels", "type"], rows)


def hashes_list(hashes: dict[str, str]) -> list[str]:
    """SHA-256 of the files of each scan."""
    if not hashes:
        return []
    rows = [f"   {number}  {path}" for path, number in hashes.items()]
    return ["SHA-256 (of several files: one after the other)::", "", *rows, ""]
