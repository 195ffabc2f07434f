# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of other programs, papers and closed forms that docs/validation.md sets beside ours.

Between impacts the machines are linear, so that a motion with one impact per drive period solves a quadratic
equation, which gives twelve digits.
"""

import numpy as np

DIGITS = 1e-9
# where the response 0.5/|1 - w^2 + 0.04 i w| is 0.63
GRAZE = float(np.sqrt(0.9992 - np.sqrt(0.9992**2 - 1 + (0.5 / 0.63) ** 2)))

LOSS = 0.64 * float(np.exp(-0.2 * np.pi))

BUDD_DUX = "C. Budd, F. Dux, Phil. Trans. R. Soc. A 347 (1994), and their program"
COCO = "H. Dankowicz, F. Schilder, Recipes for Continuation (2013), 15.2 (COCO)"
DEN_HARTOG = "J. P. Den Hartog (1931), S. W. Shaw (1986), the dry friction example of PWSDDE-cont"
FAMILY = "G. Csernak, G. Stepan, S. W. Shaw, Nonlinear Dyn. 50 (2007)"
SOFT = "S. L. T. de Souza, M. Wiercigroch, I. L. Caldas, J. M. Balthazar (2008)"
RIG = "J. Ing, E. Pavlovskaia, M. Wiercigroch, S. Banerjee (2008, 2010), values of PWSDDE-cont"

# per source: what, theirs, half a unit of the last digit or 1e-9
THEIRS = {
    "dux.speed": (BUDD_DUX, "sigma = 0: impact speed of the unstable orbit", 0.336177269977, DIGITS),
    "dux.phase": (BUDD_DUX, "sigma = 0: phase of its impact", 3.0593767579, DIGITS),
    "dux.large": (BUDD_DUX, "sigma = 0: its first multiplier", -2.958095067, DIGITS),
    "dux.small": (BUDD_DUX, "sigma = 0: its second multiplier", -0.216355454, DIGITS),
    "dux.doubling": (BUDD_DUX, "period doubling: sigma", -0.068575652279, DIGITS),
    "dux.doubling_speed": (BUDD_DUX, "period doubling: impact speed", 0.493081581866, DIGITS),
    "dux.fold": (BUDD_DUX, "fold: -sigma", 1.780235601322, DIGITS),
    "dux.node": (BUDD_DUX, "sigma = -0.4: impact speed of the stable orbit", 1.244255519396, DIGITS),
    "dux.node_modulus": (BUDD_DUX, "sigma = -0.4: modulus of its multipliers", 0.8, DIGITS),
    "dux.node_catalogue": (BUDD_DUX, "sigma = -0.4: the same in the catalogue of a map", 0.8, 1e-6),
    "dux.saddle": (BUDD_DUX, "sigma = -0.4: impact speed of the saddle", 0.589092786236, DIGITS),
    "dux.saddle_phase": (BUDD_DUX, "sigma = -0.4: phase of its impact", 0.1444083387, DIGITS),
    "dux.saddle_large": (BUDD_DUX, "sigma = -0.4: its first multiplier", 4.16349147, 5e-9),
    "dux.saddle_small": (BUDD_DUX, "sigma = -0.4: its second multiplier", 0.15371714, 5e-9),
    "dux.resonant": (BUDD_DUX, "ratio 2, sigma = 0: impact speed", 20 / 3, DIGITS),
    "dux.resonant_trace": (BUDD_DUX, "ratio 2, sigma = 0: sum of the multipliers, both 0.8", 1.6, DIGITS),
    "dux.exponent": (BUDD_DUX, "sigma = 0: largest Lyapunov exponent of the chaos (1/s)", 0.14, 0.005),
    "dux.sum": (BUDD_DUX, "sigma = 0: sum of the exponents less 2 ln 0.8 per impact (1/s)", 0.0, 1e-8),
    "coco.graze": (COCO, "graze: A", 0.1, DIGITS),
    "coco.sweep_graze": (COCO, "graze in the run-up of a sweep: A", 0.1, DIGITS),
    "coco.speed": (COCO, "A = 1: impact speed", 1.695732937595, DIGITS),
    "coco.phase": (COCO, "A = 1: phase of the impact", 0.0759521649, DIGITS),
    "coco.real": (COCO, "A = 1: real part of the multipliers", -0.5842953, 5e-8),
    "coco.imaginary": (COCO, "A = 1: imaginary part of the multipliers", 0.0056004, 5e-8),
    "coco.determinant": (COCO, "A = 1: product of the multipliers, 0.64 exp(-0.2 pi)", LOSS, DIGITS),
    "coco.fold": (COCO, "fold: A", 0.099970753628, DIGITS),
    "coco.fold_speed": (COCO, "fold: impact speed", 0.004111530644, 1e-8),
    "coco.sweep_fold": (COCO, "fold in the run-down of a sweep: A", 0.099970753628, 1e-8),
    **{
        f"coco.curve.{w}": (COCO, f"grazing curve, w = {w}: A", float(np.hypot(1 - w**2, 0.1 * w)), DIGITS)
        for w in (0.5, 0.8, 0.95, 1.05, 1.3, 1.9)
    },
    "coco.doubling.0.8": (COCO, "period doubling, w = 0.8: A", 0.518209866598, DIGITS),
    "coco.doubling.0.95": (COCO, "period doubling, w = 0.95: A", 0.535598788701, DIGITS),
    "coco.fold.1.05": (COCO, "fold, w = 1.05: A", 0.105602768669, DIGITS),
    "coco.fold.1.9": (COCO, "fold, w = 1.9: A", 2.073204825806, DIGITS),
    "coco.resonant.2": (COCO, "resonant graze w_d: w", 0.998749217772, DIGITS),
    "coco.resonant.1": (COCO, "resonant graze 2 w_d: w", 1.997498435544, DIGITS),
    "coco.tangency": (COCO, "(A_graze - A_fold)/(w - w_d)^2 at w = 1", 18.7, 0.05),
    "coco.window": (
        COCO, "width of the interval of A in which the impacting and the free motion coexist", 2.92e-5, 5e-8),
    "coco.order": (COCO, "order of the tangency, from the differences at two distances", 2.0, 0.02),
    "coco.ninefold": (COCO, "A_graze - A_fold at nine times the distance, relative to w = 1", 80, 1),
    "hartog.amplitude": (DEN_HARTOG, "w = 0.9: amplitude", 2.420236350574, DIGITS),
    "hartog.onset_amplitude": (DEN_HARTOG, "amplitude at the lower onset of stick", 2.0480411205, DIGITS),
    "hartog.low": (DEN_HARTOG, "onset of stick, break-away 1.1: lower w", 0.748685731631, DIGITS),
    "hartog.high": (DEN_HARTOG, "onset of stick, break-away 1.1: upper w", 1.206269084208, DIGITS),
    "hartog.plain_low": (DEN_HARTOG, "onset of stick, break-away 1: lower w", 0.722679194438, DIGITS),
    "hartog.plain_high": (DEN_HARTOG, "onset of stick, break-away 1: upper w", 1.235747152322, DIGITS),
    "hartog.undamped_low": (DEN_HARTOG, "onset of stick, no viscous term: lower w", 0.667225314477, DIGITS),
    "hartog.undamped_high": (DEN_HARTOG, "onset of stick, no viscous term: upper w", 1.387047497113, DIGITS),
    "family.multiplier": (FAMILY, "Omega = 1/2: multiplier of an orbit of the family", 1.0, DIGITS),
    "family.quarter": (FAMILY, "Omega = 1/4: multiplier of an orbit of the family", 1.0, DIGITS),
    "family.catalogue": (FAMILY, "Omega = 1/2: entries of the catalogue that are cycles or families", 1, 0),
    "family.kind": (FAMILY, "Omega = 1/2: of these, families", 1, 0),
    "soft.amplitude": (SOFT, "amplitude of the free motion", 0.605668066477, DIGITS),
    "soft.chaos": (SOFT, "coexisting motions without a period", 1, 0),
    "soft.graze": (SOFT, "graze of the free motion: w", GRAZE, DIGITS),
    "rig.0.7": (RIG, "first graze, a = 0.7: w", 0.8019, 5e-5),
    "rig.0.9": (RIG, "first graze, a = 0.9: w", 0.7639, 5e-5),
}  # fmt: skip

# located once more by the command `branches`, which is given a range of a parameter and nothing else
FOLLOWED = (
    *("dux.doubling", "dux.fold", "coco.graze", "coco.fold", "coco.curve.0.8", "coco.doubling.0.8"),
    *("coco.curve.0.95", "coco.doubling.0.95", "coco.curve.1.05", "coco.fold.1.05"),
    *("coco.curve.1.9", "coco.fold.1.9", "hartog.low", "hartog.high", "hartog.plain_low"),
    *("hartog.plain_high", "hartog.undamped_low", "hartog.undamped_high", "soft.graze"),
    *("coco.resonant.1", "coco.resonant.2"),
)
THEIRS = {
    name: row
    for key, (source, what, *digits) in THEIRS.items()
    for name, row in (
        (key, (source, what, *digits)),
        (f"{key}.branches", (source, f"{what}, by `branches`", *digits)),
    )
    if name == key or key in FOLLOWED
}

# what the program cannot be asked today
NOT_YET = (
    ("G. Csernak, G. Licsko, Meccanica 56 (2021); Int. J. Bifurcation Chaos 24 (2014)",
     "asymmetric and chaotic responses with a static excess", "parameters not available"),
    (RIG, "branches and coexistence", "printed as figures only"),
    (SOFT, "basins", "printed as figures only"),
    ("J. F. Mason, P. T. Piiroinen, R. E. Wilson, M. E. Homer (2009)", "basins of gear rattle",
     "printed as figures only"),
    ("manual of InvariantManifolds.jl", "unstable manifold of an inverted pendulum between walls",
     "printed as a figure only"),
    ("examples of Siconos, cam follower", "impact maps at 358, 660 and 700 rpm",
     "not run: profile of the cam not available"),
)  # fmt: skip
