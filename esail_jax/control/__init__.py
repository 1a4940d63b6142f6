"""Parts of voltage laws that users write: sensors with noise, delay or failures, and sources that fail.

A law is an `equinox.Module` (`loads/own_law.py`). Every wrapper here is one as well, and takes the law that
it wraps as `law`; the wrapped law must have a control period.

    law = control.Delayed(control.Noisy(MyLaw(...), {"angular_velocity": 1e-6}, seed=1), samples=2)
    solution = esail.simulate("baseline", voltage_law=law)
"""

from esail_jax.control.wrappers import Delayed, FailedSource, Noisy, Without

__all__ = ["Delayed", "FailedSource", "Noisy", "Without"]
