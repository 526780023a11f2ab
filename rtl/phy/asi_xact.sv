// SPDX-License-Identifier: Apache-2.0
// asi_xact: one call on the line: request, answer or classified error, immediate repetitions, and every gap.
// One timer counts the clocks since the anchor as an oscilloscope on the pins would: a strobe of the filter arrives
// StrobeDelay clocks after its pulse and so sets the timer to StrobeDelay. Each state compares it with one limit.
// A result is one pulse of res_valid_o; the other res_* outputs are valid in that clock only. So are att_*.
// Read-back: a second receiver hears the own request. What it says changes the class of the attempt and nothing else:
// the gaps are those of what is heard afterwards.
// Requirements: LT-002 .. LT-009, LT-011, LT-012, RX-012 .. RX-014 (docs/requirements.md).
module asi_xact
  import asi_map_pkg::*;
#(
  parameter int unsigned ClkHz       = 16_000_000,
  parameter bit          ReadBack    = 1'b1,  // 0: what comes until P_TX_MASK after the own request is ignored
  parameter int unsigned HalfBitNs   = asi_timing_pkg::HalfBitNs,
  parameter int unsigned WinEarlyNs  = asi_timing_pkg::WinEarlyNs,
  parameter int unsigned WinLateNs   = asi_timing_pkg::WinLateNs,
  parameter int unsigned FilterNs    = asi_timing_pkg::FilterNs,
  parameter int unsigned RxQuietNs   = asi_timing_pkg::RxQuietNs,
  parameter int unsigned TxMaskNs    = asi_timing_pkg::TxMaskNs,
  parameter int unsigned EchoMaxNs   = asi_timing_pkg::EchoMaxNs,
  parameter int unsigned RxOpenNs    = asi_timing_pkg::RxOpenNs,
  parameter int unsigned RxTimeoutNs = asi_timing_pkg::RxTimeoutNs,
  parameter int unsigned GapOkNs     = asi_timing_pkg::GapOkNs,
  parameter int unsigned GapNorspNs  = asi_timing_pkg::GapNorspNs,
  parameter int unsigned GapErrNs    = asi_timing_pkg::GapErrNs,
  parameter int unsigned BabbleMaxNs = asi_timing_pkg::BabbleMaxNs,
  parameter int unsigned IdleStartNs = asi_timing_pkg::IdleStartNs,
  parameter int unsigned TxBiasNs    = asi_timing_pkg::TxBiasNs
) (
  input  logic         clk_i, rst_i,    // rst_i: synchronous, active high
  // 0: nothing starts, an open call ends as ABORTED; what is being sent is completed
  input  logic         enable_i,
  input  logic         req_valid_i,     // a request is offered; taken in the clock in which req_ready_o is 1 as well
  output logic         req_ready_o,     // the gap is over
  input  logic [10:0]  req_call_i,      // CB, A4..A0, I4..I0
  input  logic         req_sel_i,       // the call is for a B slave; for att_index_o only
  input  logic [1:0]   req_retries_i,   // immediate repetitions after a failure
  input  logic         req_no_reply_i,  // silence is success
  output logic         res_valid_o,     // one clock per request taken
  output error_class_e res_last_o, res_first_o,  // class of the last and of the first attempt
  output logic [3:0]   res_data_o,      // answer, when res_last_o is OK
  output logic [1:0]   res_repeats_o,   // repetitions made
  output logic         sent_o, repeat_o,  // one clock per request on the line; repeat_o: it is a repetition
  // one clock per attempt that was judged: not when aborted, not for broadcasts
  output logic         att_valid_o,
  output logic [5:0]   att_index_o,     // sel and number of the request
  output error_class_e att_class_o,
  output logic         att_repeat_o, att_final_o,  // it was a repetition; the call ends with it
  // when an answer came: own last edge to its first pulse, and its largest deviation, in clocks
  output logic [15:0]  att_delay_o,
  output logic [7:0]   att_dev_o,
  output logic         att_dev_late_o,
  output logic         pulse_n_o, pulse_p_o,  // one clock per filtered pulse on the line
  input  logic         rx_p_i, rx_n_i,  // pins: comparators, asynchronous
  output logic         tx_man_o, tx_en_o  // pins: Manchester level, bias on
);
  localparam int unsigned StrobeDelay = asi_timing_pkg::strobe_delay(FilterNs, ClkHz);
  localparam int unsigned TxMask      = asi_timing_pkg::clocks(TxMaskNs, ClkHz);
  // latest decision over the own request, from its last edge: a latest echo and what asi_rx waits after it
  localparam int unsigned EchoEnd     = asi_timing_pkg::clocks(EchoMaxNs, ClkHz) +
                                        asi_timing_pkg::clocks(RxQuietNs, ClkHz) +
                                        asi_timing_pkg::clocks(WinLateNs, ClkHz);
  localparam int unsigned RxOpen      = asi_timing_pkg::clocks(RxOpenNs, ClkHz);
  localparam int unsigned RxTimeout   = asi_timing_pkg::clocks(RxTimeoutNs, ClkHz);
  localparam int unsigned GapOk       = asi_timing_pkg::clocks(GapOkNs, ClkHz);
  // this one from the last request pulse, like the time-out before it
  localparam int unsigned GapNorsp    = RxTimeout + asi_timing_pkg::clocks(GapNorspNs, ClkHz);
  localparam int unsigned GapErr      = asi_timing_pkg::clocks(GapErrNs, ClkHz);
  localparam int unsigned IdleStart   = asi_timing_pkg::clocks(IdleStartNs, ClkHz);
  localparam int unsigned BabbleMax   = asi_timing_pkg::clocks(BabbleMaxNs, ClkHz);
  localparam int unsigned Bias        = asi_timing_pkg::clocks(TxBiasNs, ClkHz);

  function automatic int unsigned max(int unsigned a, int unsigned b);
    return (a > b) ? a : b;
  endfunction
  localparam int unsigned TxTime  = 26 * asi_timing_pkg::clocks(HalfBitNs, ClkHz);  // first to last edge of a request
  localparam int unsigned TimeW   = $clog2(max(max(GapNorsp, IdleStart), max(TxTime, max(GapOk, GapErr))) + 1);
  localparam int unsigned BabbleW = $clog2(BabbleMax);

  // a gap of g clocks: first edge at g means start at g - 1 (asi_tx) and armed_q set one clock after its limit
  function automatic logic [TimeW-1:0] gap_limit(int unsigned gap, logic armed);
    return armed ? TimeW'(gap - 1) : (gap > Bias + 2) ? TimeW'(gap - Bias - 2) : '0;
  endfunction

  typedef enum logic [3:0] {
    StOff, StIdle, StReady, StTx, StOwn, StEarly, StListen, StReceive, StGapOk, StGapNorsp, StGapErr
  } state_e;
  state_e             state_d, state_q;
  logic [TimeW-1:0]   time_d, time_q, limit;
  logic               reached;            // time_q has come to the limit of this state
  logic [BabbleW-1:0] babble_d, babble_q;
  logic               babble_end;         // waited long enough for quiet
  logic               armed_d, armed_q;   // in a gap: P_TX_BIAS before its end
  logic               open_d, open_q;     // a call is open; in a gap: its repetition is due
  logic [10:0]        call_d, call_q;
  logic               sel_d, sel_q;
  logic [1:0]         retries_d, retries_q, repeats_d, repeats_q;
  logic               no_reply_d, no_reply_q;
  error_class_e       first_d, first_q;   // class of the first attempt, OK while it has none
  error_class_e       attempt_class;
  logic               bad_d, bad_q;       // the own request did not come back as sent
  logic [TimeW-1:0]   delay_d, delay_q;   // own last edge to the first answer pulse
  logic               attempt_done, can_start, start, quiet_wait, gap;

  logic         rx_p, rx_n, p_start, n_start, pulse;
  logic         tx_busy, tx_last, rx_en, rx_first, rx_done;
  error_class_e rx_class;
  logic         echo_en, echo_done, echo_good;

  asi_sync #(.Width(2)) i_sync (.clk_i, .rst_i, .async_i({rx_p_i, rx_n_i}), .sync_o({rx_p, rx_n}));
  asi_pulse_filter #(.ClkHz(ClkHz), .FilterNs(FilterNs)) i_filter_p (.clk_i, .rst_i, .pulse_i(rx_p), .start_o(p_start));
  asi_pulse_filter #(.ClkHz(ClkHz), .FilterNs(FilterNs)) i_filter_n (.clk_i, .rst_i, .pulse_i(rx_n), .start_o(n_start));
  asi_tx #(.ClkHz(ClkHz), .HalfBitNs(HalfBitNs)) i_tx (
    .clk_i, .rst_i, .start_i(start), .arm_i((armed_q || (state_q == StReady && enable_i)) && (open_q || req_valid_i)),
    .call_i(open_q ? call_q : req_call_i), .busy_o(tx_busy), .last_o(tx_last), .tx_man_o, .tx_en_o
  );
  asi_rx #(
    .ClkHz(ClkHz), .HalfBitNs(HalfBitNs), .WinEarlyNs(WinEarlyNs), .WinLateNs(WinLateNs), .RxQuietNs(RxQuietNs)
  ) i_rx (
    .clk_i, .rst_i, .n_start_i(n_start), .p_start_i(p_start), .en_i(rx_en),
    .first_o(rx_first), .done_o(rx_done), .class_o(rx_class), .data_o(res_data_o), .dev_o(att_dev_o),
    .dev_late_o(att_dev_late_o)
  );
  if (ReadBack) begin : g_echo
    error_class_e echo_class;
    logic [10:0]  echo_data;
    asi_rx #(
      .ClkHz(ClkHz), .Bits(14), .HalfBitNs(HalfBitNs), .WinEarlyNs(WinEarlyNs), .WinLateNs(WinLateNs),
      .RxQuietNs(RxQuietNs)
    ) i_echo (
      .clk_i, .rst_i, .n_start_i(n_start), .p_start_i(p_start), .en_i(echo_en),
      .first_o(), .done_o(echo_done), .class_o(echo_class), .data_o(echo_data), .dev_o(), .dev_late_o()
    );
    // a first pulse too late needs no check of its own: then there is no decision until the limit of StOwn
    assign echo_good = echo_done && (echo_class == ErrOk) && (echo_data == call_q);
  end else begin : g_no_echo
    assign echo_done = 1'b0;
    assign echo_good = 1'b1;
  end

  assign pulse = p_start || n_start;
  assign pulse_n_o = n_start;
  assign pulse_p_o = p_start;
  // from the own first edge on: what began before it is not its business
  assign echo_en = (state_q == StTx && reached) || (state_q == StOwn);
  assign rx_en = (state_q == StListen) || (state_q == StReceive);
  assign quiet_wait = (state_q == StIdle) || (state_q == StGapErr);
  assign gap        = quiet_wait || (state_q == StGapOk) || (state_q == StGapNorsp);
  assign reached    = time_q >= limit;
  assign babble_end = babble_q == BabbleW'(BabbleMax - 2);
  assign can_start  = enable_i && (babble_end || (!pulse && reached && (state_q == StReady || (gap && armed_q))));
  assign req_ready_o = can_start && !open_q;
  assign start       = can_start && (open_q || req_valid_i);
  assign sent_o      = start;
  assign repeat_o    = start && open_q;

  always_comb begin
    unique case (state_q)
      StTx:       limit = TimeW'(StrobeDelay);
      StOwn:      limit = TimeW'((ReadBack ? EchoEnd : TxMask) + StrobeDelay);
      StEarly:    limit = TimeW'(RxOpen + StrobeDelay - 1);
      StListen:   limit = TimeW'(RxTimeout + StrobeDelay);
      StGapOk:    limit = gap_limit(GapOk, armed_q);
      StGapNorsp: limit = gap_limit(GapNorsp, armed_q);
      StGapErr:   limit = gap_limit(GapErr, armed_q);
      StIdle:     limit = gap_limit(IdleStart, armed_q);
      StReady:    limit = TimeW'(Bias);
      default:    limit = '0;
    endcase
  end

  always_comb begin
    state_d = state_q;  time_d = time_q + 1'b1;  attempt_done = 1'b0;  attempt_class = rx_class;
    armed_d = gap && !pulse && (armed_q || reached);
    bad_d   = bad_q;  delay_d = delay_q;
    if (pulse) time_d = TimeW'(StrobeDelay + 1);
    unique case (state_q)
      // StOff: disabled; what is being sent is sent to its end
      StOff: begin
        time_d = '0;
        if (enable_i && !tx_busy) state_d = StIdle;
      end
      // StIdle: P_IDLE_START of quiet after StOff
      StIdle: ;
      // StReady: nothing to wait for but a request; it is given the whole P_TX_BIAS
      StReady: if (!req_valid_i && !pulse) time_d = '0;
      // StTx: own request, timed from its first edge; the last one is the anchor of the next four states
      StTx: begin
        time_d = tx_last ? TimeW'(1) : time_q + 1'b1;
        if (tx_last) state_d = StOwn;
      end
      // StOwn: echo of the own request, until it is judged
      StOwn: begin
        time_d = time_q + 1'b1;  bad_d = !echo_good;
        if (echo_done || reached) state_d = StEarly;
      end
      // StEarly: no slave may answer yet
      StEarly: if (pulse) begin
        attempt_done = 1'b1;  attempt_class = ErrEarly;  state_d = StGapErr;
      end else if (reached) state_d = StListen;
      // StListen: until P_RX_TIMEOUT, inclusive
      StListen: if (rx_first) begin
        state_d = StReceive;  delay_d = time_q - TimeW'(StrobeDelay);
      end else if (reached) begin
        attempt_done = 1'b1;  attempt_class = no_reply_q ? ErrOk : ErrNoResponse;  state_d = StGapNorsp;
      end
      // StReceive: the receiver decides; the anchor is the last pulse, whichever it was
      StReceive: if (rx_done) begin
        attempt_done = 1'b1;  state_d = (rx_class == ErrOk) ? StGapOk : StGapErr;
      end
      // gaps: what comes now belongs to nobody, the line must be quiet again
      StGapOk, StGapNorsp, StGapErr: if (pulse) state_d = StGapErr;
      default: state_d = StOff;
    endcase
    if (state_q == StReady && pulse) state_d = StGapErr;
    if (bad_q) attempt_class = ErrBadMaster;  // nobody knows what the slaves heard
    if (can_start) begin
      state_d = start ? StTx : StReady;  time_d = '0;  armed_d = 1'b0;
    end
    if (!enable_i) state_d = StOff;
    babble_d = (quiet_wait && !can_start && enable_i) ? babble_q + 1'b1 : '0;  // 0 in StOff: it ends no wait there
  end

  always_comb begin
    open_d = open_q;  call_d = call_q;  sel_d = sel_q;  retries_d = retries_q;  no_reply_d = no_reply_q;
    repeats_d = repeats_q;  first_d = first_q;
    res_valid_o = 1'b0;  res_last_o = attempt_class;  att_valid_o = 1'b0;
    att_final_o = attempt_class == ErrOk || repeats_q == retries_q;
    if (start && !open_q) begin
      open_d    = 1'b1;            call_d     = req_call_i;      first_d   = ErrOk;  sel_d = req_sel_i;
      retries_d = req_retries_i;   no_reply_d = req_no_reply_i;  repeats_d = '0;
    end
    if (start && open_q) repeats_d = repeats_q + 1'b1;
    if (open_q && !enable_i) begin
      res_valid_o = 1'b1;  res_last_o = ErrAborted;  open_d = 1'b0;
    end else if (attempt_done) begin
      if (first_q == ErrOk) first_d = attempt_class;
      att_valid_o = !no_reply_q;
      if (att_final_o) begin res_valid_o = 1'b1; open_d = 1'b0; end
    end
    res_first_o   = (first_q == ErrOk) ? res_last_o : first_q;
    res_repeats_o = repeats_q;
    att_index_o   = {sel_q, call_q[9:5]};
    att_class_o   = attempt_class;
    att_repeat_o  = repeats_q != '0;
    att_delay_o   = 16'(delay_q);
  end

  always_ff @(posedge clk_i) begin
    state_q    <= rst_i ? StOff : state_d;
    time_q     <= rst_i ? '0    : time_d;
    babble_q   <= rst_i ? '0    : babble_d;
    armed_q    <= rst_i ? 1'b0  : armed_d;
    open_q     <= rst_i ? 1'b0  : open_d;
    call_q     <= call_d;   // these six are set when a call opens
    sel_q      <= sel_d;
    retries_q  <= retries_d;
    no_reply_q <= no_reply_d;
    repeats_q  <= repeats_d;
    first_q    <= first_d;
    bad_q      <= bad_d;    // set after each request
    delay_q    <= delay_d;  // set by the first answer pulse
  end

`ifndef SYNTHESIS
  initial begin
    Mask_A: assert (TxMask < RxOpen && EchoEnd < RxOpen && RxOpen < RxTimeout);
    Time_A: assert (TimeW <= 16);                             // att_delay_o
    Gaps_A: assert (GapNorsp > RxTimeout + StrobeDelay + 2);  // the time-out is decided before its gap ends
  end
  logic res_q;  // the last clock had a result
  always_ff @(posedge clk_i) begin
    res_q <= !rst_i && res_valid_o;
    if (!rst_i) begin
      OneResult_A:  assert (!(res_valid_o && res_q));
      OpenResult_A: assert (!res_valid_o || open_q);
      Quiet_A:      assert (!start || !tx_busy);
      Enabled_A:    assert (!start || enable_i);
      Repeats_A:    assert (!open_q || repeats_q <= retries_q);
      TxState_A:    assert (!tx_busy || tx_en_o);
      Attempt_A:    assert (!attempt_done || open_q);
      Judged_A:     assert (!att_valid_o || (open_q && enable_i && att_final_o == res_valid_o));
      Echo_A:       assert (!echo_done || state_q == StOwn);  // never before the own last edge
      BadMaster_C:  cover (attempt_done && attempt_class == ErrBadMaster);
      Babble_C:     cover (babble_end);
      Repeat_C:     cover (repeat_o);
      Aborted_C:    cover (res_valid_o && res_last_o == ErrAborted);
      Early_C:      cover (attempt_done && attempt_class == ErrEarly);
      BackToBack_C: cover (start && gap);
    end
  end
`endif
endmodule
