# SPDX-License-Identifier: Apache-2.0
"""What a decoder sees of libsigrokdecode (API 3), on samples in memory, as far as the AS-i decoder needs it.

As a program: sigrokdecode.py < JSON, runs a decoder folder and prints one JSON line per put(). Keys: folder, samples
(file, one byte per sample), rate (Hz or null), channels {number: bit}, options, eof (False: as 0.5.3, whose wait()
fails without an exception of its own at the end of the samples; True: EOFError, as later versions).
"""
import json
import sys
from bisect import bisect_left

SRD_CONF_SAMPLERATE = 10000
OUTPUT_ANN, OUTPUT_PYTHON, OUTPUT_BINARY = "ann", "python", "binary"


class Decoder:
    def attach(self, samples, channels, options, eof, out):
        self._fake_bits = channels
        self._fake_samples, self._fake_eof, self._fake_out = samples, eof, out
        self._fake_next = self.samplenum = 0
        self.matched = ()
        self.options = options
        self._fake_edges = {}    # channel -> sample numbers
        changes = [k for k in range(1, len(samples)) if samples[k] != samples[k - 1]]
        for channel, bit in channels.items():
            self._fake_edges[channel] = [k for k in changes if (samples[k] ^ samples[k - 1]) >> bit & 1]

    def register(self, kind):
        return kind

    def has_channel(self, channel):
        return channel in self._fake_bits

    def put(self, start, stop, kind, data):
        assert isinstance(start, int) and isinstance(stop, int) and 0 <= start < stop, (start, stop)
        if kind == OUTPUT_BINARY:
            data = [data[0], data[1].decode()]
        self._fake_out(json.dumps([start, stop, kind, data]))

    def wait(self, conditions=()):
        conditions = [conditions] if isinstance(conditions, dict) else list(conditions)
        ends = []
        for condition in conditions:
            (channel, kind), = condition.items()
            if channel == "skip":
                ends.append(self.samplenum + kind)
            else:
                assert kind == "e", kind
                edges = self._fake_edges[channel]
                at = bisect_left(edges, self._fake_next)
                ends.append(edges[at] if at < len(edges) else float("inf"))
        end = min(ends)
        if end >= len(self._fake_samples):
            if self._fake_eof:
                self.samplenum = len(self._fake_samples) - 1
                raise EOFError("samples exhausted")
            raise SystemError("wait returned NULL without setting an exception")
        self.matched = tuple(e == end for e in ends)
        self.samplenum, self._fake_next = end, end + 1
        value = self._fake_samples[end]
        return tuple(value >> self._fake_bits[k] & 1 if k in self._fake_bits else 255 for k in range(3))


def main():
    job = json.load(sys.stdin)
    sys.modules["sigrokdecode"] = sys.modules["__main__"]
    sys.path.insert(0, job["folder"])
    module = __import__("asi")
    decoder = module.Decoder()
    for option in module.Decoder.options:
        job["options"].setdefault(option["id"], option["default"])
    with open(job["samples"], "rb") as file:
        samples = file.read()
    decoder.attach(samples, {int(k): bit for k, bit in job["channels"].items()}, job["options"], job["eof"], print)
    if job["rate"]:
        decoder.metadata(SRD_CONF_SAMPLERATE, job["rate"])
    decoder.start()
    try:
        decoder.decode()
    except SystemError as error:    # 0.5.3 ends every decoder like this
        if "NULL" not in str(error):
            raise
    outside = [name for name, loaded in sys.modules.items() if "site-packages" in str(getattr(loaded, "__file__", ""))]
    assert not outside, outside


if __name__ == "__main__":
    main()
