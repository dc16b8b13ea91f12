"""All experiments on claims of the paper, in the order of the page."""

from __future__ import annotations

import _paper_blocked
import _paper_ccd
import _paper_cell
import _paper_cost
import _paper_genetic
import _paper_line
import _paper_modes
import _paper_prm
import _paper_rivals
import _paper_savings
import _paper_spline
import _paper_withdrawal
from _paper_result import Experiment

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        *_paper_rivals.EXPERIMENTS,
        _paper_prm.EXPERIMENT,
        _paper_ccd.EXPERIMENT,
        _paper_blocked.EXPERIMENT,
        _paper_withdrawal.EXPERIMENT,
        _paper_genetic.EXPERIMENT,
        _paper_cost.EXPERIMENT,
        _paper_spline.EXPERIMENT,
        _paper_savings.EXPERIMENT,
        _paper_line.EXPERIMENT,
        _paper_modes.EXPERIMENT,
        _paper_cell.EXPERIMENT,
    )
}
