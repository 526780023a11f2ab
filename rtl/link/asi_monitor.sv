// SPDX-License-Identifier: Apache-2.0
// asi_monitor: one record in the monitor ring for every telegram on the line, whoever sent it. It listens only.
// Two receivers, 7 and 14 bits, start with the first pulse after a pause. The time goes into the ring with that pulse,
// the rest with the decision. Words: telegram_r in rdl/asi.rdl.
//   Answer or request: the first telegram between P_RX_OPEN and P_RX_TIMEOUT after a good request is its answer. Any
//   other is a request when a pulse comes between 37.5 and 43.5 us, else an answer that stands alone.
//   EARLY: a telegram that begins before P_RX_OPEN after a good request; recorded as an answer.
//   Pause: P_PAUSE after a good request or the good answer to it. After all else, and when it begins to
//   listen, BadPauseNs (18 us, longer than the hole that missing pulses of one bit leave), restarted by every pulse;
//   such a hole ends the telegram in which it is, unless that is an answer, whose 43.5 us are always waited for.
// Data and deviation are those of the 14-bit receiver, which has seen what the 7-bit one has; only the class differs.
// Of a telegram with a failed check, data are the bits that came. A telegram on the line when enable_i falls or clear_i
// comes has no record and is not counted as lost. The ring holds 255 records: head = tail is empty.
// Against the Python library (asi.monitor, one record per call), on the same pulses:
//   - a good request, then a pulse before 85.5 us from its start: here the request has LENGTH, there the call is EARLY;
//     a later pulse that is still inside the pause has no record here;
//   - a pulse between the decision on a good answer and the end of the pause: no record here, a request there;
//   - a bad telegram without a good request before it is always a bad request there; here it is an answer if no
//     pulse comes between 37.5 and 43.5 us, and its class may name a check of 7 bits instead of NO_INFORMATION;
//   - no answer has no record here.
// Requirements: ST-006 .. ST-008 (docs/requirements.md).
module asi_monitor
  import asi_map_pkg::*;
#(
  parameter int unsigned ClkHz       = 16_000_000,
  parameter int unsigned HalfBitNs   = asi_timing_pkg::HalfBitNs,
  parameter int unsigned WinEarlyNs  = asi_timing_pkg::WinEarlyNs,
  parameter int unsigned WinLateNs   = asi_timing_pkg::WinLateNs,
  parameter int unsigned FilterNs    = asi_timing_pkg::FilterNs,
  parameter int unsigned RxQuietNs   = asi_timing_pkg::RxQuietNs,
  parameter int unsigned RxOpenNs    = asi_timing_pkg::RxOpenNs,
  parameter int unsigned RxTimeoutNs = asi_timing_pkg::RxTimeoutNs,
  parameter int unsigned PauseNs     = asi_timing_pkg::PauseNs,
  parameter int unsigned BadPauseNs  = asi_timing_pkg::BadPauseNs,
  parameter int unsigned RingW       = 8               // log2 of the records in the ring
) (
  input  logic             clk_i, rst_i,               // rst_i: synchronous, active high
  input  logic             n_start_i, p_start_i,       // strobes of asi_pulse_filter
  input  logic             enable_i,
  input  logic             clear_i,                    // one clock: empties the ring, lost_o becomes 0
  input  logic [RingW-1:0] tail_i,                     // next record the reader will take
  output logic [RingW-1:0] head_o,                     // next record to be written
  output logic [15:0]      lost_o,                     // records that found the ring full; stops at FFFF
  // monitor ring, word addresses
  output logic             mem_req_o, mem_we_o,
  output logic [RingW:0]   mem_addr_o,
  output logic [31:0]      mem_wdata_o
);
  localparam int unsigned StrobeDelay = asi_timing_pkg::strobe_delay(FilterNs, ClkHz);
  localparam int unsigned Pause       = asi_timing_pkg::clocks(PauseNs, ClkHz);
  localparam int unsigned BadPause    = asi_timing_pkg::clocks(BadPauseNs, ClkHz);
  localparam int unsigned RxOpen      = asi_timing_pkg::clocks(RxOpenNs, ClkHz);
  localparam int unsigned RxTimeout   = asi_timing_pkg::clocks(RxTimeoutNs, ClkHz);
  localparam int unsigned QuietW      = $clog2(RxTimeout + 2);
  // the last window of an answer closes here; a later pulse says that the telegram is a request
  localparam int unsigned AnswerEnd   = asi_timing_pkg::clocks(12 * HalfBitNs + WinLateNs, ClkHz);
  localparam int unsigned AgeW        = $clog2(AnswerEnd + asi_timing_pkg::clocks(RxQuietNs, ClkHz) + 2);
  // time stamps: 1/8 us; the counter begins so far below 0 that a strobe reads the time of its pulse
  localparam int unsigned Tick        = ClkHz / 8_000_000;
  localparam int unsigned TickW       = (Tick > 1) ? $clog2(Tick) : 1;
  localparam int unsigned LagTicks    = (StrobeDelay + Tick - 1) / Tick;
  localparam int unsigned LagClocks   = LagTicks * Tick - StrobeDelay;

  typedef enum logic [1:0] {StSync, StIdle, StTelegram, StRequest} state_e;
  state_e            state_d, state_q;
  logic [QuietW-1:0] quiet_d, quiet_q;     // clocks since the last pulse; wraps, so its marks are kept:
  logic              pause_d, pause_q, hole_d, hole_q;  // the clock before the end of a pause, of the long one, or later
  logic              open_d, open_q, over_d, over_q;    // P_RX_OPEN reached, P_RX_TIMEOUT passed
  logic [AgeW-1:0]   age_d, age_q;         // StTelegram: clocks since the first pulse
  logic [TickW-1:0]  tick_q;
  logic [31:0]       time_q;
  logic              bad_d, bad_q;         // StSync: the long pause is needed
  logic              asked_d, asked_q;     // the last telegram was a good request
  logic              answer_d, answer_q;   // this one is the answer to it
  logic              early_d, early_q;     // ... or came before an answer may
  logic              behind_d, behind_q;   // behind the end of an answer ...
  logic              long_d, long_q;       // ... a pulse came
  logic [RingW-1:0]  head_d, head_q;
  logic [15:0]       lost_d, lost_q;
  logic              mark_d, mark_q;       // the next record is marked: some before it were lost
  logic              pulse, hole, listen, full, record, is_request, decided7;
  logic              done7, done14, late7, late;
  error_class_e      class7, class14, error;
  logic [3:0]        data7;
  logic [10:0]       data;
  logic [7:0]        dev7, dev;
  /* verilator lint_off PINCONNECTEMPTY */  // first_o: the pulse itself says it
  asi_rx #(.ClkHz(ClkHz), .Bits(7), .HalfBitNs(HalfBitNs), .WinEarlyNs(WinEarlyNs), .WinLateNs(WinLateNs),
           .RxQuietNs(RxQuietNs)) u_rx7 (
    .clk_i, .rst_i, .n_start_i, .p_start_i, .en_i(listen && state_q != StRequest), .first_o(), .done_o(done7),
    .class_o(class7), .data_o(data7), .dev_o(dev7), .dev_late_o(late7)
  );
  asi_rx #(.ClkHz(ClkHz), .Bits(14), .HalfBitNs(HalfBitNs), .WinEarlyNs(WinEarlyNs), .WinLateNs(WinLateNs),
           .RxQuietNs(RxQuietNs)) u_rx14 (
    .clk_i, .rst_i, .n_start_i, .p_start_i, .en_i(listen && !decided7), .first_o(), .done_o(done14),
    .class_o(class14), .data_o(data), .dev_o(dev), .dev_late_o(late)
  );
  /* verilator lint_on PINCONNECTEMPTY */

  // "will be over in the next clock, unless a pulse comes now": a pulse right at the end of a pause is after it
  assign pulse  = n_start_i || p_start_i;
  assign hole   = !pulse && hole_q;
  assign listen = state_q != StSync && !(hole && state_q != StIdle && !answer_q);
  // the end of an answer; what begins later than an answer may end says that this is a request
  assign decided7 = state_q == StTelegram && done7 && (!long_d || answer_q || early_q);
  assign full   = head_q + 1'b1 == tail_i;

  always_comb begin
    state_d  = state_q;   bad_d   = bad_q;    asked_d = asked_q;
    answer_d = answer_q;  early_d = early_q;
    record   = 1'b0;      is_request = 1'b0;  error   = class14;
    quiet_d  = pulse ? QuietW'(1) : quiet_q + 1'b1;
    pause_d  = !pulse && (pause_q || quiet_q == QuietW'(Pause - 2));
    hole_d   = !pulse && (hole_q || quiet_q == QuietW'(BadPause - 2));
    open_d   = !pulse && (open_q || quiet_q == QuietW'(RxOpen - 1));
    over_d   = !pulse && (over_q || quiet_q == QuietW'(RxTimeout));
    behind_d = state_q == StTelegram && (behind_q || age_q == AgeW'(AnswerEnd));
    long_d   = state_q == StTelegram && (long_q || (pulse && behind_q));
    age_d    = age_q + 1'b1;
    unique case (state_q)
      // StSync: waits for a pause
      StSync: begin
        if (pulse) bad_d   = 1'b1;
        if (pulse) asked_d = 1'b0;
      end
      // StIdle: the next pulse is the first of a telegram
      StIdle: if (pulse) begin
        state_d  = StTelegram;
        age_d    = AgeW'(1);
        early_d  = asked_q && !open_q;
        answer_d = asked_q && open_q && !over_q;
        asked_d  = 1'b0;
      end
      // StTelegram: the first 43.5 us
      StTelegram: begin
        if (done7) state_d = StRequest;
        if (decided7) begin
          error   = early_q ? ErrEarly : class7;
          record  = 1'b1;
          state_d = StSync;
          bad_d   = class7 != ErrOk || !answer_q;
        end
      end
      // StRequest: the rest of a request
      StRequest: begin
        is_request = 1'b1;
        if (done14) begin
          record  = 1'b1;
          state_d = StSync;
          bad_d   = class14 != ErrOk;
          asked_d = class14 == ErrOk;
        end
      end
      default: state_d = StSync;
    endcase
    // a hole: what is there is no telegram any more; the next pulse may begin one
    if (state_q != StSync && !listen) begin
      record  = 1'b1;
      error   = early_q ? ErrEarly : class14;
      state_d = StIdle;
    end
    if (state_d == StSync && !pulse && (bad_d ? hole_q : pause_q)) state_d = StIdle;
    if (!enable_i || clear_i) begin
      state_d = StSync;  bad_d = 1'b1;  asked_d = 1'b0;  record = 1'b0;
    end
  end

  // ring: the word at head is always free, so the time may be written before it is known whether there is room
  always_comb begin
    head_d = head_q;  lost_d = lost_q;  mark_d = mark_q;
    if (record && full) begin
      mark_d = 1'b1;
      lost_d = lost_q + 16'(lost_q != '1);
    end
    if (record && !full) begin
      mark_d = 1'b0;
      head_d = head_q + 1'b1;
    end
    if (clear_i) begin head_d = tail_i; lost_d = '0; mark_d = 1'b0; end
    mem_req_o  = record ? !full : state_q == StIdle && pulse;
    mem_addr_o = {head_q, record};
    mem_wdata_o = time_q;
    if (record) begin
      mem_wdata_o = '0;
      mem_wdata_o[RecordDataLsb +: RecordDataW]           = {data[10:4] & {7{is_request}}, data[3:0]};
      mem_wdata_o[RecordRequestLsb]                       = is_request;
      mem_wdata_o[RecordErrorLsb +: RecordErrorW]         = error;
      mem_wdata_o[RecordDeviationLsb +: RecordDeviationW] = dev;
      mem_wdata_o[RecordLateLsb]                          = late;
      mem_wdata_o[RecordLostLsb]                          = mark_q;
    end
  end
  assign mem_we_o = 1'b1;
  assign head_o   = head_q;
  assign lost_o   = lost_q;

  always_ff @(posedge clk_i) begin
    state_q <= rst_i ? StSync : state_d;
    bad_q   <= rst_i || bad_d;
    asked_q <= !rst_i && asked_d;
    quiet_q <= rst_i ? '0 : quiet_d;
    {pause_q, hole_q, open_q, over_q} <= rst_i ? '0 : {pause_d, hole_d, open_d, over_d};
    head_q  <= rst_i ? '0 : head_d;
    lost_q  <= rst_i ? '0 : lost_d;
    mark_q  <= !rst_i && mark_d;
    tick_q  <= rst_i ? TickW'(LagClocks) : (tick_q == TickW'(Tick - 1)) ? '0 : tick_q + 1'b1;
    time_q  <= rst_i ? -32'(LagTicks) : time_q + 32'(tick_q == TickW'(Tick - 1));
    // set by the first pulse, so they need no reset
    behind_q <= behind_d;
    age_q <= age_d;  answer_q <= answer_d;  early_q <= early_d;  long_q <= long_d;
  end

`ifndef SYNTHESIS
  initial begin
    ClkHz_A: assert (ClkHz >= 8_000_000 && ClkHz % 8_000_000 == 0);
    Pause_A: assert (Pause >= 3 && Pause < RxOpen && Pause < BadPause && BadPause <= RxTimeout);
  end
  always_ff @(posedge clk_i) if (!rst_i) begin
    OneWord_A: assert (!record || !(state_q == StIdle && pulse));
    Open_A:    assert (!record || state_q == StTelegram || state_q == StRequest);
`ifndef FORMAL  // the proof of the ring leaves the receivers free
    Hole_A:    assert (state_q == StSync || listen || class14 != ErrOk);
    Same_A:    assert (!done7 || class7 != ErrOk || long_q || {data[3:0], dev, late} == {data7, dev7, late7});
`endif
    Either_A:  assert (!(answer_q && early_q) || state_q == StSync || state_q == StIdle);
    Answer_C:  cover (record && answer_q && error == ErrOk);
    Request_C: cover (record && is_request && error == ErrOk);
    Early_C:   cover (record && error == ErrEarly);
    HoleEnd_C: cover (record && !listen);
    Length_C:  cover (record && answer_q && error == ErrLength);
    Lost_C:    cover (record && full);
    Marked_C:  cover (record && !full && mark_q);
  end
`else
  logic unused;
  assign unused = ^{data7, dev7, late7};
`endif
endmodule
