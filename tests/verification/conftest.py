"""The small frame of struts of `frame`, ready for micro DVC."""

import pytest

from addvc.correlation.micro import elastic, micro_options, micro_reference
from addvc.correlation.stages import Problem
from addvc.fem.shell import shell_points
from addvc.geometry.stuffing import stuff
from verification.frame import SECTION, image


@pytest.fixture(scope="module")
def still():
    return image(lambda x: x, 2417)


@pytest.fixture(scope="module")
def problem(still):
    mesh = stuff(still, 60.0, 1.6)
    reference = micro_reference(mesh, still, shell_points(mesh, still, 60.0))
    options = micro_options(SECTION, 20.0, 1)
    return Problem(reference, elastic(reference, options)[2]["c"], options.nu, options.l_e)
