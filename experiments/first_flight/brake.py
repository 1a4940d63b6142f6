"""How long does a plasma brake fly until the density of the plasma about it is known from the orbit?

python experiments/first_flight/brake.py    # writes brake.csv, and prints a fit of synthetic data
"""

import numpy as np
from run import GOALS, HERE, write

import esail_jax as esail
from esail_jax.identification.fit import Problem
from esail_jax.identification.uncertainty import uncertainty_of

DENSITY = "plasma_brake.number_density"
PLACES = ("initial.position[1]", "initial.position[2]", "initial.velocity[1]", "initial.velocity[2]")
"""Of the satellite in the plane of the orbit, at first: from a receiver, and so not known before."""
RECEIVER = 5.0
"""Assumed: the error of every position by a receiver of navigation satellites [m], once a minute."""


def shown(scene, random=None):
    """Positions of the satellite in the plane of the orbit, with noise if there are random numbers."""
    times = np.arange(0.0, scene.integrator.t_end, 60.0)
    run = esail.simulate(scene, save=("joint_position",), times=times.tolist())
    exact = np.asarray(run["joint_position"])[:, 0, :2]
    seen = exact + (0.0 if random is None else RECEIVER * random.normal(size=exact.shape))
    return {"time": times, "joint_position[1,1]": seen[:, 0], "joint_position[1,2]": seen[:, 1]}


def errors(problem, jacobian, used):
    """Relative errors of the density, by the instants at which a flight may end [s], with the parameters
    that are used free."""
    cells = problem.cells[0]
    time, x = np.array(cells.times)[cells.row], (jacobian / cells.deviations[:, None])[:, used]
    ends, names = np.array(cells.times)[3:], [problem.names[k] for k in used]
    sd = [uncertainty_of(names, np.ones(len(used)), x[time <= end]).sd[0] for end in ends]
    return ends, np.array(sd) / problem.parameters[0].start


def main():
    scene = esail.load_scene(str(HERE / "brake.toml"))
    noise = {"joint_position": RECEIVER}
    problem = Problem.of(scene, shown(scene, np.random.default_rng(78)), [DENSITY, *PLACES], noise)
    jacobian = problem.models[0](np.array([p.start for p in problem.parameters])).jacobian
    rows = []
    for label, used in {"known": [0], "free": [0, 1, 2, 3, 4]}.items():
        ends, sd = errors(problem, jacobian, used)
        row = {"position and velocity at first": label}
        for goal in GOALS:
            reached = ends[np.argmax(sd <= goal)] if (sd <= goal).any() else np.inf
            row[f"{goal:.0%} [min]"] = reached / 60.0
        rows.append(row | {"after two orbits [%]": 100.0 * sd[-1]})
    write("brake.csv", rows)
    print(problem.solved())


if __name__ == "__main__":
    main()
