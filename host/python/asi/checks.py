# SPDX-License-Identifier: Apache-2.0
"""Receiver checks on the pulses of one telegram (RX-001 .. RX-010), for slaves and monitor. Times in ns.

Two forms: classify() judges a whole telegram and reports in the fixed order; RequestCollector follows a request pulse
by pulse and knows at once when it went wrong, as a slave does.
"""
from asi.regmap import ErrorClass

HALF_BIT_NS = 3_000
WIN_EARLY_NS = 875          # P_WIN_EARLY
WIN_LATE_NS = 1_500         # P_WIN_LATE
REQUEST_BITS = 14
ANSWER_BITS = 7
QUIET_NS = 6_000            # one quiet bit time after a telegram (answer, and request seen by a synchronous slave)
QUIET_ASYNC_NS = 18_000     # three of them after a request seen by an asynchronous slave


def end_ns(bits):
    """Nominal start of the end pulse, from the first pulse: 78 us for a request, 36 us for an answer."""
    return (bits - 1) * 2 * HALF_BIT_NS


def window(dt_ns):
    """Half-bit number n >= 1 whose window (n*3 us -0.875/+1.5 us, both ends included) holds dt_ns, else None."""
    n, late = divmod(dt_ns + WIN_EARLY_NS, HALF_BIT_NS)
    return int(n) if n >= 1 and late <= WIN_EARLY_NS + WIN_LATE_NS else None


def deviation(pulses):
    """Largest distance of a pulse from its grid point, ns, with its sign; pulses of a good telegram: see classify()."""
    return max((dt - HALF_BIT_NS * (window(dt) or 0) for dt, _ in pulses), key=abs)


def classify(pulses, bits, quiet_ns=QUIET_NS):
    """[(ns from the first pulse, polarity)] -> (ErrorClass, word or None).

    Three things the wording of the checks leaves open: a second pulse in one window is a timing error (it could flip a
    bit); the telegram ends with the pulse in the last window, what follows is judged by length only; without such a
    pulse a later one is a timing error. Pulses after the length window are ignored.
    """
    end = end_ns(bits)
    # of two senders' opposite pulses at one instant the positive one counts as the first
    pulses = sorted((p for p in pulses if p[0] <= end + quiet_ns + WIN_LATE_NS), key=lambda p: (p[0], -p[1]))
    values = {0: pulses[0][1]}
    seen = {0}
    alternation = timing = length = False
    previous = pulses[0][1]
    for dt, polarity in pulses[1:]:
        if bits - 1 in values:
            length = True
            continue
        n = window(dt)
        alternation |= polarity == previous
        timing |= n is None or n in seen or n > 2 * (bits - 1)
        seen.add(n)
        previous = polarity
        if n is not None and n % 2 == 0 and n <= 2 * (bits - 1):
            values.setdefault(n // 2, polarity)
    if pulses[0][1] > 0:
        return ErrorClass.START, None
    if alternation:
        return ErrorClass.ALTERNATION, None
    if timing:
        return ErrorClass.TIMING, None
    if len(values) < bits:
        return ErrorClass.NO_INFORMATION, None
    word = sum((values[k] > 0) << (bits - 1 - k) for k in range(bits))
    if not word & 1:
        return ErrorClass.END_BIT, word
    if (word >> 1).bit_count() & 1:         # the start bit is 0 here and does not count
        return ErrorClass.PARITY, word
    return (ErrorClass.LENGTH, None) if length else (ErrorClass.OK, word)


def bit_values(pulses, bits):
    """What the pulses say about each bit, good telegram or not: [0, 1 or None without a pulse in its window]."""
    out = [None] * bits
    for dt, polarity in pulses:
        n = 0 if dt == 0 else window(dt)
        if n is not None and n % 2 == 0 and n // 2 < bits and out[n // 2] is None:
            out[n // 2] = int(polarity > 0)
    return out


class RequestCollector:
    """A request while it arrives. t0: its first pulse; call: the 11 bits once it is complete and good."""

    def __init__(self, t_ns, polarity):
        self.t0 = t_ns
        self.call = None
        self._values = [polarity]
        self._last = polarity
        self._window = 0
        self._good = polarity < 0

    def add(self, t_ns, polarity):
        """The next pulse -> False when the request cannot be good any more."""
        n = window(t_ns - self.t0)
        bits = self._values
        if not self.alive(t_ns) or polarity == self._last or n is None or n == self._window:
            self._good = False
        elif n % 2 == 0 and n // 2 == len(bits):
            bits.append(polarity)
            if len(bits) == REQUEST_BITS:
                self._finish()
        self._last, self._window = polarity, n
        return self._good

    def alive(self, t_ns):
        """False when a check has failed by t_ns, be it that a bit's window passed without a pulse."""
        waiting = len(self._values) < REQUEST_BITS
        deadline = self.t0 + len(self._values) * 2 * HALF_BIT_NS + WIN_LATE_NS
        return self._good and not (waiting and t_ns > deadline)

    def _finish(self):
        word = 0
        for polarity in self._values:
            word = word << 1 | (polarity > 0)
        if word & 1 and not (word >> 1).bit_count() & 1:
            self.call = word >> 2
        else:
            self._good = False
