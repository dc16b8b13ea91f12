"""All experiments on claims of the paper, in the order of the page."""

from __future__ import annotations

import _paper_cost
import _paper_rivals
import _paper_savings
import _paper_spline
from _paper_result import Experiment

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        *_paper_rivals.EXPERIMENTS,
        _paper_cost.EXPERIMENT,
        _paper_spline.EXPERIMENT,
        _paper_savings.EXPERIMENT,
    )
}
