// SPDX-License-Identifier: Apache-2.0
// asi_timing_pkg: every time of the line, in nanoseconds, and the one way to turn it into clocks.
// Names and values: requirements LT-001 .. LT-016 (docs/requirements.md). Anchors are pulse starts.
package asi_timing_pkg;
  localparam int unsigned HalfBitNs   = 3_000;       // half a bit, the pulse grid
  localparam int unsigned WinEarlyNs  = 875;         // P_WIN_EARLY: a pulse may start this early
  localparam int unsigned WinLateNs   = 1_500;       // P_WIN_LATE: ... or this late
  localparam int unsigned FilterNs    = 750;         // comparator pulses shorter than this are ignored
  localparam int unsigned RxQuietNs   = 6_000;       // P_RX_QUIET: silence after the end pulse of an answer
  localparam int unsigned RxOpenNs    = 12_000;      // P_RX_OPEN: earliest answer after the last request pulse
  localparam int unsigned TxMaskNs    = 4_500;       // P_TX_MASK: own last pulse until here, its echo is masked
  localparam int unsigned EchoMaxNs   = 3_000;       // P_ECHO_MAX: latest own pulse on the receive pins after its edge
  localparam int unsigned RxTimeoutNs = 66_000;      // P_RX_TIMEOUT: latest answer after the last request pulse
  localparam int unsigned GapOkNs     = 18_500;      // P_GAP_OK: last answer pulse to the next request
  localparam int unsigned GapNorspNs  = 6_000;       // P_GAP_NORSP: end of the time-out to the next request
  localparam int unsigned GapErrNs    = 24_000;      // P_GAP_ERR: quiet time after a bad answer
  localparam int unsigned BabbleMaxNs = 1_000_000;   // P_BABBLE_MAX: longest wait for that quiet time
  localparam int unsigned IdleStartNs = 60_000;      // P_IDLE_START: quiet time before the first request
  localparam int unsigned TxBiasNs    = 12_000;      // P_TX_BIAS: longest lead of tx_en before the first edge
  localparam int unsigned ApfOnNs     = 1_000_000;   // P_APF_ON: power low this long -> APF
  localparam int unsigned ApfOkNs     = 10_000_000;  // P_APF_OK: power good this long -> no APF
  localparam int unsigned JabberNs    = 300_000;     // P_JABBER: a sender on for longer is cut off
  localparam int unsigned PauseNs     = 8_375;       // P_PAUSE: longest gap in a telegram: 6 us, one early, one late
  localparam int unsigned VthClearNs  = 2_000;       // P_VTH_CLEAR: then the held amplitude is dropped for this long
  localparam int unsigned EfNs        = 1_000_000_000;  // P_EF: earth fault present or gone for this long
  localparam int unsigned ApfDipNs    = 6_000;       // states of the power input shorter than this are ignored

  // Clocks in a time; ClkHz is a whole multiple of 8 MHz, so every time above is a whole count.
  function automatic int unsigned clocks(int unsigned ns, int unsigned clk_hz);
    return int'((longint'(ns) * longint'(clk_hz)) / 64'd1_000_000_000);
  endfunction

  // Clocks from a pulse on a pin to its strobe: asi_sync (2) and asi_pulse_filter (FilterNs). A pin that changes
  // between two clock edges counts as if it had changed with the earlier one; that is the only uncertainty there is.
  localparam int unsigned SyncClocks = 2;
  function automatic int unsigned strobe_delay(int unsigned filter_ns, int unsigned clk_hz);
    return clocks(filter_ns, clk_hz) + SyncClocks;
  endfunction
endpackage
