"""Attitude messages: a public reader reads what is written, and the quaternions turn as they should."""

import numpy as np
import pytest
from ccsds_ndm.ndm_io import NdmIo
from scipy.spatial.transform import Rotation

from esail_jax.calendar.frames import TO_EQUATOR
from esail_jax.calendar.instants import after, read_instant
from esail_jax.messages.writing import Head, aem_text

HEAD = Head(read_instant("2026-01-02T03:04:05", "x"), "ESAIL JAX", "SAIL 1", "2027-012A")
TIMES = 20.0 * np.arange(60.0)
TURNS = Rotation.from_rotvec(np.outer(0.1 * np.arange(60.0), [0.6, 0.0, 0.8])) * Rotation.from_euler(
    "y", 1.1
)


@pytest.mark.parametrize("scale", ["UTC", "TDB"])
def test_the_reader_ccsds_ndm_reads_the_rows(scale):
    """To the last printed digit. A vector fixed in the body is where the simulation has it: the quaternion
    from A to B turns the axes of EME2000 to those of the body."""
    at = after(read_instant(f"2027-03-01T00:00:00 {scale}", "x"), TIMES)
    text = aem_text(HEAD, at, TURNS.as_matrix())
    (segment,) = NdmIo().from_string(text).body.segment
    meta = segment.metadata
    assert (meta.ref_frame_a, meta.ref_frame_b, meta.attitude_dir.value) == ("EME2000", "SC_BODY_1", "A2B")
    assert (meta.attitude_type.value, meta.quaternion_type.value) == ("QUATERNION", "LAST")
    assert meta.time_system.value == scale
    found = [x.quaternion_state for x in segment.data.attitude_state]
    words = [x.split() for x in text.partition("DATA_START\n")[2].split("\n")[:-2]]
    assert [x.epoch for x in found] == [x[0] for x in words]
    assert (meta.start_time, meta.stop_time) == (found[0].epoch, found[-1].epoch)
    parts = [x.quaternion for x in found]
    numbers = np.array([[x.q1, x.q2, x.q3, x.qc] for x in parts], float)
    assert np.array_equal(numbers, np.array([x[1:] for x in words], float))
    assert np.abs(Rotation.from_quat(numbers).as_matrix() - TO_EQUATOR @ TURNS.as_matrix()).max() < 1e-11
    assert np.einsum("ti,ti->t", numbers[1:], numbers[:-1]).min() > 0.99


def test_the_text_is_that_of_the_standard():
    at = after(read_instant("2027-03-01T00:00:00", "x"), np.array([0.0, 0.5]))
    assert aem_text(HEAD, at, np.array([TO_EQUATOR.T, TO_EQUATOR.T])).split("\n") == [
        "CCSDS_AEM_VERS       = 1.0",
        "CREATION_DATE        = 2026-01-02T03:04:05",
        "ORIGINATOR           = ESAIL JAX",
        "",
        "META_START",
        "OBJECT_NAME          = SAIL 1",
        "OBJECT_ID            = 2027-012A",
        "REF_FRAME_A          = EME2000",
        "REF_FRAME_B          = SC_BODY_1",
        "ATTITUDE_DIR         = A2B",
        "TIME_SYSTEM          = UTC",
        "START_TIME           = 2027-03-01T00:00:00.000000000",
        "STOP_TIME            = 2027-03-01T00:00:00.500000000",
        "ATTITUDE_TYPE        = QUATERNION",
        "QUATERNION_TYPE      = LAST",
        "META_STOP",
        "",
        "DATA_START",
        "2027-03-01T00:00:00.000000000 0.000000000000 0.000000000000 0.000000000000 1.000000000000",
        "2027-03-01T00:00:00.500000000 0.000000000000 0.000000000000 0.000000000000 1.000000000000",
        "DATA_STOP",
        "",
    ]
