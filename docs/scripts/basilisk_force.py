"""Drives two spacecraft of Basilisk with the forces of a run, and compares them with the run.

    python docs/scripts/basilisk_force.py sail.csv sail.oem sail.aem --mass 5561.646
        --hub-mass 5554.336 --hub-inertia 2777.168 3240.029 3240.029

"sail" is a point with the mass of the whole sail under its thrust; "hub" is the rigid hub under the forces
and the moment of its tethers. Both start as the hub of the run and are attracted by the Sun. The module
`extForceTorque` holds a force over a step: it gets the mean over the step of a cubic spline through the
table, so that the momentum at the end of every step is that of the spline."""

import argparse
from pathlib import Path

import numpy as np
from Basilisk.architecture import messaging, sysModel
from Basilisk.simulation import extForceTorque, spacecraft
from Basilisk.utilities import RigidBodyKinematics as rbk
from Basilisk.utilities import SimulationBaseClass, macros, simIncludeGravBody
from run_table import SOLAR_MU, in_words, read_message, read_table
from scipy.interpolate import CubicSpline


class TableForce(sysModel.SysModel):
    """Writes the mean over the step that ends now of a force in N [N] and of a torque in B [N m]."""

    def __init__(self, step: float, force: CubicSpline, torque: CubicSpline):
        super().__init__()
        self.step, self.impulse, self.twist = step, force.antiderivative(), torque.antiderivative()
        self.force, self.torque = messaging.CmdForceInertialMsg(), messaging.CmdTorqueBodyMsg()

    def UpdateState(self, nanoseconds: int) -> None:
        end = nanoseconds * macros.NANO2SEC
        force, torque = ((x(end) - x(end - self.step)) / self.step for x in (self.impulse, self.twist))
        message = messaging.CmdForceInertialMsgPayload(forceRequestInertial=force.tolist())
        self.force.write(message, nanoseconds, self.moduleID)
        message = messaging.CmdTorqueBodyMsgPayload(torqueRequestBody=torque.tolist())
        self.torque.write(message, nanoseconds, self.moduleID)


class Driven:
    """A spacecraft under the Sun, a force in N and a torque in B, with the modules that drive it."""

    def __init__(self, name: str, step: float, mass: float, inertia: np.ndarray, *given: CubicSpline):
        self.table = TableForce(step, *given)
        self.load = extForceTorque.ExtForceTorque()
        self.load.cmdForceInertialInMsg.subscribeTo(self.table.force)
        self.load.cmdTorqueInMsg.subscribeTo(self.table.torque)
        self.body = spacecraft.Spacecraft()
        for module, part in ((self.table, "table"), (self.load, "load"), (self.body, "body")):
            module.ModelTag = f"{name} {part}"
        self.body.hub.mHub, self.body.hub.IHubPntBc_B = mass, np.diag(inertia).tolist()
        self.body.addDynamicEffector(self.load)
        self.recorded = self.body.scStateOutMsg.recorder()

    def start(self, state: np.ndarray, attitude: np.ndarray, rate: np.ndarray) -> None:
        """Sets position [m] and velocity [m/s], the rotation from N to B, and the angular velocity in B."""
        hub = self.body.hub
        hub.r_CN_NInit, hub.v_CN_NInit = state[:3].tolist(), state[3:].tolist()
        hub.sigma_BNInit, hub.omega_BN_BInit = rbk.C2MRP(attitude).tolist(), rate.tolist()


def main(given: argparse.Namespace) -> None:
    table = read_table(given.table)
    time, orbit = read_message(given.orbit)
    _, quaternions = read_message(given.attitude)
    orbit *= 1e3
    to_body = np.stack([rbk.EP2C(np.roll(x, 1)) for x in quaternions])

    thrust, reaction, moment = (
        table.in_eme2000(f"{x}_O") for x in ("thrust", "reaction", "reaction_moment")
    )
    # Reactions are those on the tethers: on the hub they act with the other sign.
    torque = -np.einsum("tij,tj->ti", to_body, moment)
    none = CubicSpline(time, np.zeros_like(thrust))
    hub_inertia = np.array(given.hub_inertia)
    sail = Driven("sail", given.step, given.mass, hub_inertia, CubicSpline(time, thrust), none)
    hub = Driven(
        "hub",
        given.step,
        given.hub_mass,
        hub_inertia,
        CubicSpline(time, -reaction),
        CubicSpline(time, torque),
    )

    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("process")
    process.addTask(simulation.CreateNewTask("task", macros.sec2nano(given.step)))
    bodies = simIncludeGravBody.gravBodyFactory()
    sun = bodies.createSun()
    sun.isCentralBody, sun.mu = True, SOLAR_MU
    for driven in (sail, hub):
        bodies.addBodiesTo(driven.body)
        driven.start(table.start(), to_body[0], table.vectors["angular_velocity_B"][0])
        for module in (driven.table, driven.load, driven.body, driven.recorded):
            simulation.AddModelToTask("task", module)
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(macros.sec2nano(time[-1]))
    simulation.ExecuteSimulation()

    every = np.round(time / given.step).astype(int)
    for name, driven in (("sail", sail), ("hub", hub)):
        state = np.hstack([driven.recorded.r_BN_N, driven.recorded.v_BN_N])[every]
        apart = state[:, :3] - orbit[:, :3], state[:, 3:] - orbit[:, 3:]
        print(f"{name} from the hub of the run: {in_words(*apart)}")
        if name == "sail":
            centre = table.from_hub_to_centre(given.mass)
            left = (x - y for x, y in zip(apart, centre, strict=True))
            print(f"{name} from the centre of mass of the run: {in_words(*left)}")
    found = np.stack([rbk.MRP2C(x) for x in hub.recorded.sigma_BN[every]])
    turned = np.sqrt(((found - to_body) ** 2).sum(axis=(1, 2)) / 2.0)
    print(f"hub turned from that of the run by {np.degrees(turned.max()):.2g} deg at most")


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument("table", type=Path, help="table of the run (.csv)")
    options.add_argument("orbit", type=Path, help="its orbit (.oem)")
    options.add_argument("attitude", type=Path, help="its attitude (.aem)")
    options.add_argument("--mass", type=float, required=True, help="mass of the whole sail [kg]")
    options.add_argument("--hub-mass", type=float, required=True, help="mass of the hub [kg]")
    options.add_argument(
        "--hub-inertia", type=float, nargs=3, required=True, help="about X_B, Y_B, Z_B [kg m^2]"
    )
    options.add_argument("--step", type=float, default=1.0, help="step of Basilisk [s], by default 1")
    main(options.parse_args())
