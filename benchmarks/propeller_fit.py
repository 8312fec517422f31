"""The propeller of scenarios/la8.toml, fitted to wind-tunnel data: `python benchmarks/propeller_fit.py`.

Aeronaut CAM folding 16 x 8 in, two blades, University of Illinois propeller database, volume 3 (Brandt,
Deters, Ananda, Dantsker, Selig), at the rotor speeds that the aircraft flies with. Fits the form of
`freqid.simulate.loads.propeller`; writes benchmarks/propeller_fit.csv beside the table it prints.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

PROPELLER = "ancf 16.0x8.0 - 2"
SLOWEST_RPM = 3900.0  # below, low Reynolds numbers cost thrust that this form does not model
# A stopped propeller is beyond the data: -35e-3 rho D^2 U^2 is the drag of its blades as flat plates.
STOPPED_THRUST = -0.035
DATA = Path(__file__).resolve().parents[2] / "shared" / "data" / "uiuc_props" / "volume3_exp.csv"


def columns(j: np.ndarray) -> np.ndarray:
    """Return the form's columns, shape (column, sample): a cubic in J, bounded where J is large."""
    s = np.sqrt(1.0 + j**2)
    return np.array([np.ones_like(j), j, j**2 / s, j**3 / s])


def main() -> None:
    if not DATA.is_file():
        sys.exit(f"{DATA.name}: not found beside this checkout; see the README of the shared data")
    with DATA.open() as file:
        rows = [r for r in csv.DictReader(file) if r["PropName"] == PROPELLER and float(r["N"]) > SLOWEST_RPM]
    j, ct, cp = (np.array([float(r[k]) for r in rows]) for k in ("J", "CT", "CP"))
    phi = columns(j)
    cq = cp / (2 * np.pi)
    thrust = np.linalg.lstsq(phi[:3].T, ct - STOPPED_THRUST * phi[3], rcond=None)[0]
    fits = {
        "CT": (ct, np.append(thrust, STOPPED_THRUST)),
        "CQ": (cq, np.linalg.lstsq(phi.T, cq, rcond=None)[0]),
    }
    table = [["coefficient", "c0", "c1", "c2", "c3", "rms", "worst", "largest", "points", "J_low", "J_high"]]
    for name, (found, c) in fits.items():
        error = found - c @ phi
        figures = [*c, np.sqrt(np.mean(error**2)), np.abs(error).max(), found.max()]
        table.append([name, *(f"{x:.6f}" for x in figures), str(len(j)), f"{j.min():.3f}", f"{j.max():.3f}"])
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(table)
    for row in table:
        print("  ".join(f"{cell:>11}" for cell in row))


if __name__ == "__main__":
    main()
