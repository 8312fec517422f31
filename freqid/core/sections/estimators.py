"""Names of the estimators of a point model, as scenarios, commands and results write them.

Each is implemented in a module of `freqid.identify.regress` that holds an ``ESTIMATOR`` of that name. The
list stands here, apart from them, for a scenario to be checked and help to be printed without them.
"""

from __future__ import annotations

from typing import Literal, get_args

EstimatorName = Literal["least-squares", "instruments"]
ESTIMATOR_NAMES: tuple[EstimatorName, ...] = get_args(EstimatorName)
