"""What does a fit of straight tethers make of the data of flexible ones?

python experiments/first_flight/rigid.py    # writes rigid.csv
"""

import numpy as np
from run import FREE, NOISE, PRIORS, K, N, U, cubesat, shown, strength, write

from esail_jax.identification.fit import Problem

STIFF = {"tethers.elements": 1, "tethers.youngs_modulus": 7e12}
"""One truss per tether with a hundred times the stiffness: it stays straight, and stretches by 0.2 mm."""


def main():
    found = Problem.of(cubesat(STIFF), shown(cubesat()), FREE, NOISE, PRIORS).solved()
    per_length = found[K] * strength(found[N], found[U]) / (0.18 * strength(7.3e6, 4e5))
    print(found)
    print(dict(zip(found.data[0].columns, np.nansum(found.residuals[0] ** 2, axis=0), strict=True)))
    write("rigid.csv", [{
        "thrust factor": f"{found[K]:.5f}",
        "thrust per length, too large by [%]": 100.0 * (per_length - 1.0),
        "chi squared": f"{found.chi_squared:.0f}", "degrees of freedom": found.degrees_of_freedom,
        **{f"{name}, in deviations": (found[name] - start) / found.sd[found.parameters.index(name)]
           for name, start in zip(FREE[3:], (0.0, 0.05, 0.0), strict=True)},
    }])  # fmt: skip


if __name__ == "__main__":
    main()
