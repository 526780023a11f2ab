# SPDX-License-Identifier: Apache-2.0
"""Front end of a receiver: noise and band pass in front, peak hold and comparators behind.

The comparators are looked at once per receiver clock (62.5 ns), as asi_sync does; in between they do not matter.
Requirements: AN-004, AN-005 (docs/requirements.md).
"""
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .network import CLOCK_S, BandPass

CLOCK_NS = CLOCK_S * 1e9
QUIET_NS = 9_000.0       # comparators silent this long = a pause: the peak hold is empty again. EK; longer than any
                         # distance inside a telegram (6 us and windows), shorter than P_RX_OPEN, and about when the
                         # chip's rx_vth_clear_o ends (P_PAUSE + P_VTH_CLEAR after the last accepted pulse)


@dataclass(frozen=True)
class Comparators:
    """Peak hold and thresholds. V, ns; both polarities share one threshold."""
    ratio: float = 0.5           # of the first negative pulse: 0.45..0.55
    least_v: float = 0.6         # threshold while nothing is held: nothing smaller is ever seen. EK (P_RX_VMIN)
    hysteresis: float = 0.05     # of the threshold, below it. EK
    follow_ns: float = 2_500.0   # the peak hold follows the first negative pulse this long after it was seen. EK

    def levels(self, volts: np.ndarray) -> np.ndarray:
        """Voltage per clock -> comparator levels per clock: bit 0 negative, bit 1 positive pulse."""
        out = np.zeros(len(volts), np.uint8)
        quiet, follow = round(QUIET_NS / CLOCK_NS), round(self.follow_ns / CLOCK_NS)
        here = 0
        while here < len(volts):
            v = volts[here:]
            over = np.flatnonzero(np.abs(v) > self.least_v)
            if not len(over):
                break
            begin = int(over[0])
            threshold = np.full(len(v), self.least_v)
            n_on = np.flatnonzero(-v > self.least_v)
            if len(n_on):
                first = int(n_on[0])
                peak = np.maximum.accumulate(-v[first:first + follow])
                held = np.maximum(self.least_v, self.ratio * peak)
                threshold[first:first + follow] = held
                threshold[first + follow:] = held[-1]
            n, p = (_schmitt(sign * v, threshold, self.hysteresis) for sign in (-1.0, 1.0))
            active = np.flatnonzero(n | p)
            gaps = np.flatnonzero(np.diff(active) > quiet)
            end = int(active[gaps[0]] if len(gaps) else active[-1]) + quiet + 1
            out[here + begin:here + end] = (n | p << 1)[begin:end]
            here += end
        return out


def _schmitt(v: np.ndarray, threshold: np.ndarray, hysteresis: float) -> np.ndarray:
    """1 from above the threshold until below threshold * (1 - hysteresis)."""
    event = np.where(v > threshold, 1, np.where(v < threshold * (1 - hysteresis), -1, 0))
    at = np.maximum.accumulate(np.where(event != 0, np.arange(len(v)), 0))
    return (event[at] > 0).astype(np.uint8)


@dataclass(frozen=True)
class Disturbance:
    """What is on the line besides telegrams, in V at the receiver, before the band pass unless noted."""
    white_v: float = 0.0         # rms behind the band pass
    mains_v: float = 0.0         # amplitude, 50 Hz
    sine_v: float = 0.0          # amplitude of one switching frequency ...
    sine_hz: float = 100e3       # ... Hz
    burst_v: float = 0.0         # peak of damped oscillations ...
    burst_hz: float = 300e3
    burst_per_ms: float = 10.0   # ... their mean rate
    burst_decay_ns: float = 3_000.0
    dip_v: float = 0.0           # the DC falls by this much once, exponentially ...
    dip_ns: float = 20_000.0     # ... with this time constant

    def volts(self, clocks: int, band: BandPass, rng: np.random.Generator) -> np.ndarray:
        """Behind the band pass, one value per receiver clock; all phases and places from rng."""
        v = np.zeros(clocks)
        t = np.arange(clocks) * CLOCK_S
        for amplitude, hz in ((self.mains_v, 50.0), (self.sine_v, self.sine_hz)):
            if amplitude:
                gain = complex(band.gain(hz)) * np.exp(2j * np.pi * rng.random())
                v += amplitude * np.imag(gain * np.exp(2j * np.pi * hz * t))
        if self.white_v:
            v += self.white_v * _through(rng.standard_normal(clocks), band) / _white_gain(clocks, band)
        raw = np.zeros(clocks)
        if self.burst_v:
            for _ in range(rng.poisson(self.burst_per_ms * clocks * CLOCK_S * 1e3)):
                at, sign = rng.integers(clocks), rng.choice((-1.0, 1.0))
                age = t[:clocks - at]
                raw[at:] += sign * self.burst_v * np.exp(-age / (self.burst_decay_ns * 1e-9)) * \
                    np.cos(2 * np.pi * self.burst_hz * age)
        if self.dip_v:
            at = rng.integers(clocks)
            raw[at:] -= self.dip_v * (1 - np.exp(-t[:clocks - at] / (self.dip_ns * 1e-9)))
        return v + _through(raw, band, pad=True) if self.burst_v or self.dip_v else v


def _through(v: np.ndarray, band: BandPass, pad: bool = False) -> np.ndarray:
    """Band pass by FFT. pad: the end does not wrap to the beginning (not needed for noise)."""
    size = len(v)
    if not pad:
        return np.fft.irfft(np.fft.rfft(v) * _gains(size, band), size)
    long = np.concatenate([v, v[-1] * np.linspace(1, 0, size), np.zeros(size)])  # what wraps has faded by then
    return np.fft.irfft(np.fft.rfft(long) * _gains(len(long), band), len(long))[:size]


@lru_cache(maxsize=64)
def _gains(size: int, band: BandPass) -> np.ndarray:
    return band.gain(np.fft.rfftfreq(size, CLOCK_S))


@lru_cache(maxsize=64)
def _white_gain(size: int, band: BandPass) -> float:
    """rms of unit white noise behind the band pass."""
    power = np.abs(_gains(size, band)) ** 2
    return float(np.sqrt((2 * power.sum() - power[0] - (power[-1] if size % 2 == 0 else 0)) / size))
