"""A kernel of SPICE with Chebyshev polynomials, in the few records of which such a file consists."""

import struct

import numpy as np

RECORD = 1024
FTP = b"FTPSTR:\r:\n:\r\n:\r\x00:\x81:\x10\xce:ENDFTP"


def chebyshev(motion, start, stop, records, degree=13):
    """Records of a segment of type 2: a position [km] of seconds since J2000, motion(t) of shape (3, n),
    as polynomials on equal parts of the time from start to stop."""
    length = (stop - start) / records
    nodes = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    rows = []
    for k in range(records):
        middle = start + (k + 0.5) * length
        values = motion(middle + 0.5 * length * nodes)
        fitted = np.polynomial.chebyshev.chebfit(nodes, values.T, degree)
        rows.append([middle, 0.5 * length, *fitted.T.ravel()])
    return np.concatenate([*rows, [start, length, len(rows[0]), records]])


def write_kernel(path, segments, kind=2, frame=1, order="<"):
    """Writes an SPK file. segments: tuples (target, centre, start, stop, numbers), with the seconds since
    J2000 [TDB] and the numbers of the data."""
    word = 3 * RECORD // 8 + 1
    summaries, data = b"", b""
    for target, centre, start, stop, numbers in segments:
        last = word + len(numbers) - 1
        summaries += struct.pack(f"{order}2d6i", start, stop, target, centre, frame, kind, word, last)
        data += np.asarray(numbers, f"{order}f8").tobytes()
        word = last + 1
    form = b"LTL-IEEE" if order == "<" else b"BIG-IEEE"
    head = struct.pack(f"{order}8sii60siii8s", b"DAF/SPK ", 2, 6, b"test".ljust(60), 2, 2, word, form)
    head = head.ljust(699, b"\0") + FTP
    control = struct.pack(f"{order}3d", 0.0, 0.0, len(segments))
    names = b"test".ljust(40) * len(segments)
    parts = (head, control + summaries)
    file = b"".join(x.ljust(RECORD, b"\0") for x in parts) + names.ljust(RECORD)
    path.write_bytes(file + data.ljust(-(-len(data) // RECORD) * RECORD, b"\0"))
    return path
