# SPDX-License-Identifier: Apache-2.0
"""The analog line model: network, stored ngspice waveforms, front end."""
import shutil
from dataclasses import replace

import numpy as np
import pytest

from asi.telegram import pulses, request_word
from sim.line import spice
from sim.line.exchange import Hop, Receiver, receiver_amplitude
from sim.line.front_end import CLOCK_NS, QUIET_NS, Comparators, Disturbance
from sim.line.network import (CLOCK_S, EDGE_S, SLAVE, STEP_S, BandPass, Cable, Line, Load, Segment, bus, edge_current,
                              expm, point_to_point, superpose, tree)

ALONE = Segment((("master", "far", 0.2),), "master")       # nothing but the decoupling network


def _volts(times_us, heights, clocks=800, width_us=2.0):
    """Pulses like those of the line: half-sine bells of the given heights at the given starts."""
    t = np.arange(clocks) * CLOCK_NS / 1e3
    v = np.zeros(clocks)
    for start, height in zip(times_us, heights):
        inside = (t >= start) & (t < start + width_us)
        v[inside] += height * np.sin(np.pi * (t[inside] - start) / width_us) ** 2
    return v


def _pulses(levels, bit):
    """Starts in us of one comparator's pulses."""
    on = (levels & bit > 0).astype(int)
    return np.flatnonzero(np.diff(on, prepend=0) == 1) * CLOCK_NS / 1e3


@pytest.mark.parametrize("amps, vpp", [(0.055, 4.3), (0.068, 5.4)])
def test_amplitude_and_width(amps, vpp):
    """AN-001: 55..68 mA edges into 100 uH parallel 78 Ohm give 4.3..5.4 Vpp, 2.15 us wide at half height."""
    v = amps * Line(ALONE, ("far",), ("far",)).edge_responses(256)[0, 0]
    assert -2 * v.min() == pytest.approx(vpp, rel=0.02)
    assert np.count_nonzero(v < v.min() / 2) * STEP_S * 1e6 == pytest.approx(2.15, abs=0.05)


def test_edge_shape():
    """AN-001: the edge rises from 0 to 1 in 3 us, smooth at both ends, as t/T - sin(2 pi t/T)/(2 pi)."""
    t = np.linspace(-1e-6, 4e-6, 501)
    i = edge_current(t)
    assert i[0] == 0 and i[-1] == 1 and edge_current(EDGE_S / 2) == pytest.approx(0.5)
    assert np.all(np.diff(i) >= 0)
    assert np.abs(np.diff(i, 2)).max() < 2.2 * np.pi / 300 ** 2 * 1.01     # no corner: second derivative 2 pi / T^2


def test_rising_current_is_a_negative_pulse():
    """AN-001: bit 0 = falling MAN edge = rising current = negative pulse, at every place of the line."""
    r = Line(bus(), ("master",), ("master", "n15", "far")).edge_responses(512)
    for k in range(3):
        assert r[k, 0].max() < -r[k, 0].min() / 10
        assert superpose(r[k, 0], [(0.0, -1)], 0.06, 0.0, 100).min() < -1


def test_near_looks_smaller_than_far():
    """AN-002: on a long line a receiver near the power unit sees less than a far one (field rule)."""
    r = Line(bus(), ("far",), ("master", "far")).edge_responses(512)
    assert -r[1, 0].min() > 1.5 * -r[0, 0].min()


@pytest.mark.parametrize("case", spice.CASES, ids=lambda case: case.name)
def test_against_stored_ngspice(case):
    """AN-002: the model follows the stored ngspice waveforms within 5 mV (0.2 %), at every probe."""
    found, reference = spice.decimated(spice.model(case)), spice.read_reference(case)
    assert reference.shape == found.shape and np.abs(reference).max() > 2
    for k in range(len(case.probes)):
        d = spice.compare(found[k], reference[k], spice.REFERENCE_NS, with_starts=False)
        assert d.max_mv < 5 and d.max_percent < 0.2 and d.rms_mv < 1.5, (case.probes[k], d)


@pytest.mark.skipif(shutil.which("ngspice") is None, reason="ngspice is not installed; its stored waveforms are used")
@pytest.mark.parametrize("case", spice.CASES, ids=lambda case: case.name)
def test_ngspice_again(case):
    """AN-002: ngspice still gives the stored waveforms, and pulse starts within 5 ns of the model's."""
    found = spice.run(case)
    assert np.abs(spice.decimated(found) - spice.read_reference(case)).max() < 5e-3
    own = spice.model(case)
    for k in range(len(case.probes)):
        assert spice.compare(own[k], found[k], CLOCK_S * 1e9).start_ns < 5


def test_comparison_sees_a_wrong_model():
    """AN-002: 2 % more capacitance, or 20 ns of delay, does not pass the comparison with the stored waveforms."""
    case = spice.CASES[2]
    reference = spice.read_reference(case)
    off = replace(case, segment=replace(case.segment, cable=Cable(c=61.2e-12)))
    assert spice.compare(spice.decimated(spice.model(off))[0], reference[0], 500, with_starts=False).max_mv > 10
    late = np.interp(np.arange(spice.CLOCKS) - 20 / CLOCK_NS, np.arange(spice.CLOCKS), spice.model(case)[0])
    assert spice.compare(spice.decimated(late[None])[0], reference[0], 500, with_starts=False).max_mv > 10


def test_superposition():
    """AN-003: two senders at once, stepped through together, give the sum of their edge responses."""
    line = Line(tree(), ("master", "far"), ("s1",))
    r = line.edge_responses(256)
    steps, delay = 2048, 400
    ad, g1, g2 = line.discrete()
    u = np.zeros((steps + 1, 2))
    u[:, 0] = 0.06 * edge_current(np.arange(steps + 1) * STEP_S)
    u[:, 1] = -0.04 * edge_current((np.arange(steps + 1) - delay) * STEP_S)
    x, y = np.zeros(len(ad)), np.zeros(steps)
    for k in range(steps):
        y[k] = (line.c @ x)[0]
        x = ad @ x + g1 @ u[k] + g2 @ (u[k + 1] - u[k])
    expected = 0.06 * r[0, 0, :steps]
    expected[delay:] -= 0.04 * r[0, 1, :steps - delay]
    assert np.abs(y - expected).max() < 1e-9


def test_energy():
    """AN-003: what the sender delivers is stored or turned into heat; a line left alone only loses energy."""
    line = Line(tree(), ("master",), ("master",))
    ad, g1, g2 = line.discrete()
    u = 0.06 * edge_current(np.arange(1200) * STEP_S)
    x, delivered, heat, energy = np.zeros(len(ad)), 0.0, 0.0, [0.0]
    loss = -(line.a + line.a.T) / 2                    # x' loss x: power in the resistors
    for k in range(len(u) - 1):
        before, power = (line.b[:, 0] @ x) * u[k], x @ loss @ x
        x = ad @ x + g1[:, 0] * u[k] + g2[:, 0] * (u[k + 1] - u[k])
        delivered += STEP_S * (before + (line.b[:, 0] @ x) * u[k + 1]) / 2
        heat += STEP_S * (power + x @ loss @ x) / 2
        energy.append(x @ x / 2)
    assert delivered > 1e-8 and heat > 1e-8
    assert energy[-1] + heat == pytest.approx(delivered, rel=1e-4)
    free = [x]
    for _ in range(2000):
        free.append(ad @ free[-1])
    assert np.all(np.diff([v @ v for v in free]) <= 1e-18)


def test_direct_current():
    """AN-003: a constant current leaves only the drop over the cable's resistance; the inductors carry it."""
    segment = Segment((("master", "far", 100.0),), "master", cable=Cable(g=0.0))
    line = Line(segment, ("far",), ("master", "far"))
    steady = line.c @ np.linalg.solve(line.a, -line.b[:, 0])
    assert steady[0] == pytest.approx(0, abs=1e-9)
    assert steady[1] == pytest.approx(-100 * 50e-3, rel=1e-6)
    end = Line(segment, ("far",), ("far",)).edge_responses()[0, 0, -1]     # 128 us later
    assert end == pytest.approx(-5.0, rel=1e-3)


def test_reciprocity_and_refinement():
    """AN-003: sender and receiver can change places, and twice as many sections change the pulse by less than 0.2 %."""
    r = Line(tree(), ("s1", "far"), ("s1", "far")).edge_responses(512)
    assert np.abs(r[0, 1] - r[1, 0]).max() < 1e-9
    fine = Line(tree(section_m=2.5), ("s1",), ("far",)).edge_responses(512)[0, 0]
    assert np.abs(fine - r[1, 0]).max() < 0.002 * np.abs(fine).max()


def test_matrix_exponential():
    """AN-003: expm against closed forms: rotation, nilpotent, large decay."""
    w = 7.3
    e = expm(np.array([[0, w], [-w, 0]]))
    assert np.allclose(e, [[np.cos(w), np.sin(w)], [-np.sin(w), np.cos(w)]], atol=1e-10)
    assert np.allclose(expm(np.array([[0, 3.0], [0, 0]])), [[1, 3], [0, 1]])
    assert expm(np.array([[-50.0]]))[0, 0] == pytest.approx(np.exp(-50), rel=1e-6)


@pytest.mark.parametrize("segment, reason", [
    (replace(point_to_point(), power="x"), "no cable ends at 'x'"),
    (replace(point_to_point(), loads=(("y", SLAVE),)), "no cable ends at 'y'"),
    (point_to_point(101.0), "101.0 m"),
    (Segment((("a", "b", 1.0), ("b", "c", 1.0), ("c", "a", 1.0)), "a"), "no tree"),
    (Segment((("a", "b", 1.0), ("c", "d", 1.0), ("d", "c", 1.0)), "a"), "no tree"),
    (Segment((("a", "b", 0.0),), "a"), "0 m"),
])
def test_impossible_segments(segment, reason):
    """AN-003: loops, islands, too long lines and unknown nodes are refused with the reason."""
    with pytest.raises(ValueError, match=reason):
        Line(segment, (), ())


def test_cable_impedance():
    """AN-003: the default cable has 80..120 Ohm at 167 kHz, as the field asks for."""
    assert 80 <= Cable().impedance <= 120
    assert replace(Cable(), l=1.3e-6).impedance > 120


# ---------------------------------------------------------------- front end
@pytest.mark.parametrize("ratio", [0.45, 0.5, 0.55])
@pytest.mark.parametrize("height", [1.5, 2.5, 4.0])
def test_threshold_follows_the_first_pulse(ratio, height):
    """AN-004: both polarities are compared with 45..55 % of the first negative pulse, whatever its height."""
    comparators = Comparators(ratio=ratio)
    assert (ratio - 0.03) * height > comparators.least_v       # so it is the held threshold that decides
    for share, seen in ((ratio + 0.03, 1), (ratio - 0.03, 0)):
        levels = comparators.levels(_volts((2, 5, 8), (-height, share * height, -share * height)))
        assert (len(_pulses(levels, 2)), len(_pulses(levels, 1))) == (seen, 1 + seen)


def test_peak_hold_is_cleared_in_a_pause():
    """AN-004: after 9 us without a pulse the threshold starts anew; after less it does not."""
    comparators = Comparators()
    for start, seen in ((4.0 + QUIET_NS / 1e3, 1), (9.0, 0)):     # the first pulse is over at 4 us
        v = _volts((2, start), (-4.0, 1.5))            # 1.5 V: more than the least level, less than half of 4 V
        assert len(_pulses(comparators.levels(v), 2)) == seen


def test_first_pulse_is_seen_early():
    """AN-004: the first pulse crosses the least level, the others half of it: they look late, never early."""
    v = _volts((2, 8, 14, 20), (-2.5,) * 4)
    starts = _pulses(Comparators().levels(v), 1)
    assert len(starts) == 4
    late = starts - starts[0] - np.array([0, 6, 12, 18])
    assert np.all(late[1:] > 0.1) and np.all(late[1:] < 0.4)


def test_least_level():
    """AN-004: nothing below the least level is ever seen, and the hysteresis keeps noise from chattering."""
    comparators = Comparators()
    assert not comparators.levels(_volts((2, 5), (-0.59, 0.59))).any()
    assert comparators.levels(_volts((2, 5), (-0.61, 0.0))).any()
    slow = 1.0 + 0.02 * np.array([1, -1] * 200)        # around a threshold of 1 V, within the 5 % of hysteresis
    v = np.concatenate([_volts((1,), (-2.0,), 100), np.zeros(20), np.linspace(0, 1, 50), slow, np.zeros(50)])
    assert len(_pulses(comparators.levels(v), 2)) == 1


def test_disturbances():
    """AN-004: white noise has its rms behind the band pass, a sine its gain, 50 Hz is taken away, the seed decides."""
    band, size = BandPass(), 40_000
    rng = np.random.default_rng(5)
    assert np.std(Disturbance(white_v=0.2).volts(size, band, rng)) == pytest.approx(0.2, rel=0.02)
    assert np.abs(Disturbance(sine_v=1, sine_hz=100e3).volts(size, band, rng)).max() == pytest.approx(
        float(np.abs(band.gain(100e3))), rel=0.01)
    assert np.abs(Disturbance(mains_v=10).volts(size, band, rng)).max() < 0.08
    dip = [Disturbance(dip_v=2.0).volts(1856, band, np.random.default_rng(k)) for k in range(8)]
    assert 0.7 < max(-d.min() for d in dip) < 1.3 and max(d.max() for d in dip) < 0.3
    both = [Disturbance(0.1, 1, 0.1, burst_v=1.0, dip_v=1.0).volts(1856, band, np.random.default_rng(k))
            for k in (7, 7, 8)]
    assert np.array_equal(both[0], both[1]) and not np.array_equal(both[0], both[2])


def test_band_pass_in_the_network_is_the_same():
    """AN-004: the band pass as states behind the line gives what its frequency response says."""
    line = Line(point_to_point(), ("master",), ("far",))
    r = line.through((BandPass(),)).edge_responses()[0, 0, ::8]
    raw = line.edge_responses()[0, 0, ::8]
    spectrum = np.fft.rfft(np.concatenate([raw, np.zeros(3 * len(raw))])) * BandPass().gain(
        np.fft.rfftfreq(4 * len(raw), CLOCK_S))
    assert np.abs(np.fft.irfft(spectrum)[:len(r)] - r)[:1500].max() < 0.003 * np.abs(raw).max()


def test_receiver_amplitude():
    """AN-001: at 60 mA the amplitude is inside the 3..8 Vpp a receiver must take, in both directions."""
    for segment in (point_to_point(), bus(), tree()):
        for volts in receiver_amplitude(Hop(segment), Receiver()):
            assert 3 <= 0.06 * volts <= 8
    loaded = replace(bus(), loads=(*bus().loads, ("far", Load(None, None, 20e-9))))
    assert receiver_amplitude(Hop(loaded))[0] != pytest.approx(receiver_amplitude(Hop(bus()))[0], rel=0.05)


def test_superpose_places_edges():
    """AN-003: edges before, inside and after the window of superpose land where they belong."""
    r = Line(ALONE, ("far",), ("far",)).edge_responses()[0, 0]
    whole = superpose(r, [(1000.0, -1), (4000.0, 1)], 0.06, 0.0, 400)
    assert np.allclose(superpose(r, [(1000.0, -1), (4000.0, 1)], 0.06, 62.5 * 100, 300), whole[100:])
    assert not superpose(r, [(62.5 * 400, -1)], 0.06, 0.0, 400).any()
    train = [(t, p) for t, p in pulses(request_word(5), 14)]
    assert np.allclose(superpose(r, train, 0.06, 0.0, 400), sum(
        superpose(r, [pulse], 0.06, 0.0, 400) for pulse in train))
