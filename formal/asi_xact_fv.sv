// SPDX-License-Identifier: Apache-2.0
// Proof of asi_xact with its real filters, asi_tx and both asi_rx, unbounded, at the real times (8 MHz):
// LT-003..LT-008: no request starts before its gap, and it starts exactly then when it was offered in time; after a bad
// answer whose quiet has passed before its decision (one pulse, say) it starts two clocks after the decision;
// LT-007: a babbling line delays it at most P_BABBLE_MAX; LT-011: nothing starts while disabled,
// an open call ends at once; one result per request taken, with its repetitions;
// RX-014: an attempt is BAD_MASTER exactly when the second receiver did not say, in time, that the call taken came
// back; its verdict follows the rules for what came after the own first edge: asi_rx14_fv;
// ST-001, ST-003: one report per attempt that ends, none when aborted or a broadcast, with index, repetition, end and
// delay.
module asi_xact_fv import asi_map_pkg::*; (
  input logic clk_i, rst_i, enable_i, req_valid_i, req_sel_i, req_no_reply_i, rx_p_i, rx_n_i,
  input logic [10:0] req_call_i, input logic [1:0] req_retries_i
);
  // clocks at 8 MHz, counted by hand from the requirements
  localparam int GapOk = 148, GapNorsp = (66 + 6) * 8, GapErr = 24 * 8, IdleStart = 60 * 8, Babble = 8_000;
  localparam int Timeout = 66 * 8, Delay = 8, Answer = 348;  // Delay: synchroniser and filter; Answer: 43.5 us
  localparam int Request = 78 * 8, Echo = 684, EchoEnd = 84; // Echo: 85.5 us; EchoEnd: 3 us and 7.5 us
  localparam logic [3:0] StOff = 0, StIdle = 1, StReady = 2, StTx = 3, StOwn = 4, StEarly = 5, StListen = 6,
                         StReceive = 7, StGapOk = 8, StGapNorsp = 9, StGapErr = 10;
  logic         ready, res, sent, repeated, man, en;
  error_class_e last, first;
  logic [3:0]   data;
  logic [1:0]   repeats;
  logic         att, att_repeat, att_final, att_late, strobe_n, strobe_p;
  logic [5:0]   att_index;
  error_class_e att_class;
  logic [15:0]  att_delay;
  logic [7:0]   att_dev;
  asi_xact #(.ClkHz(8_000_000)) dut (
    .clk_i, .rst_i, .enable_i, .req_valid_i, .req_ready_o(ready), .req_call_i, .req_sel_i, .req_retries_i,
    .req_no_reply_i,
    .res_valid_o(res), .res_last_o(last), .res_first_o(first), .res_data_o(data), .res_repeats_o(repeats),
    .sent_o(sent), .repeat_o(repeated), .att_valid_o(att), .att_index_o(att_index), .att_class_o(att_class),
    .att_repeat_o(att_repeat), .att_final_o(att_final), .att_delay_o(att_delay), .att_dev_o(att_dev),
    .att_dev_late_o(att_late), .pulse_n_o(strobe_n), .pulse_p_o(strobe_p), .rx_p_i, .rx_n_i, .tx_man_o(man),
    .tx_en_o(en)
  );

  typedef enum logic [1:0] {GapIsIdle, GapIsOk, GapIsNorsp, GapIsErr} gap_e;
  logic        init_q = 1'b1, live_q = 1'b0;
  logic        open_q;            // a request was taken and has no result
  logic        served_q;          // waited P_BABBLE_MAX for quiet in vain, before a request was offered
  gap_e        gap_q;             // which gap the next request has to keep
  logic [10:0] quiet_q;           // clocks on the pins since the last pulse, or since the line was switched on
  logic [10:0] own_q;             // clocks since the own last edge
  logic [13:0] wait_q;            // clocks spent waiting for quiet
  logic        offered_q;         // a request or repetition was due all the time since the decision
  logic        offered;
  logic [1:0]  dec_q;             // clocks since the decision, at most 3
  logic [3:0]  state;
  logic        taken, echo_on;
  int          need, since, rx_t, echo_t, tx_t, shifts;
  logic [10:0] call_q;            // of the call taken, with the next three
  logic        sel_q, quiet_ok_q;
  logic [1:0]  retries_q;
  logic [1:0]  again_q;           // repetitions sent
  logic        good_q;            // this request came back
  logic        judged_q;          // this attempt was reported
  logic [15:0] delay_q;           // of its answer
  function automatic logic [10:0] count(logic [10:0] n);
    return (n == '1) ? n : n + 1'b1;
  endfunction
  assign state   = dut.state_q;
  assign taken   = req_valid_i && ready;
  assign offered = offered_q && (dut.open_q || req_valid_i);
  assign need    = gap_q == GapIsOk ? GapOk : gap_q == GapIsNorsp ? GapNorsp : gap_q == GapIsErr ? GapErr : IdleStart;
  assign since   = gap_q == GapIsNorsp ? int'(own_q) : int'(quiet_q);
  assign rx_t    = int'(dut.i_rx.win_q) * 24 + int'(dut.i_rx.ph_q) - 7;
  assign echo_on = dut.g_echo.i_echo.state_q && state inside {StTx, StOwn};
  assign echo_t  = int'(dut.g_echo.i_echo.win_q) * 24 + int'(dut.g_echo.i_echo.ph_q) - 7;
  always_comb begin               // the place of asi_tx in its request: its lowest 1 is the end bit
    shifts = 13;
    for (int k = 12; k >= 0; k--) if (dut.i_tx.bits_q[k]) shifts = k;
    tx_t = 48 * shifts + (dut.i_tx.state_q == 2'd2 ? 24 : 0) + int'(dut.i_tx.cnt_q);
  end

  always_ff @(posedge clk_i) begin
    init_q <= 1'b0;
    if (init_q) assume (rst_i);
    live_q <= 1'b1;
    open_q <= !rst_i && ((open_q && !res) || taken);
    own_q  <= dut.tx_last ? 11'd1 : count(own_q);
    wait_q <= !rst_i && enable_i && !dut.can_start && (state == StIdle || state == StGapErr) ? wait_q + 1'b1 : '0;
    quiet_q <= (state == StOff || rst_i) ? '0 : dut.pulse ? 11'(Delay + 1) : count(quiet_q);
    served_q <= !rst_i && (state == StReady ? served_q : dut.babble_end);
    if (rst_i || !enable_i || state == StOff)         gap_q <= GapIsIdle;
    else if (dut.attempt_done)
      gap_q <= (state == StListen) ? GapIsNorsp :
               (state == StReceive && dut.rx_class == ErrOk) ? GapIsOk : GapIsErr;
    else if (dut.pulse && state != StIdle)            gap_q <= GapIsErr;
    dec_q <= (dut.attempt_done && !rst_i) ? 2'd1 : (dec_q == 2'd3 || rst_i) ? 2'd3 : dec_q + 1'b1;
    if (dut.attempt_done || state == StOff)           offered_q <= 1'b1;
    else                                              offered_q <= offered;
    if (taken) {call_q, sel_q, retries_q, quiet_ok_q} <= {req_call_i, req_sel_i, req_retries_i, req_no_reply_i};
    if (sent) begin
      good_q  <= 1'b0;  judged_q <= 1'b0;
      again_q <= taken ? 2'd0 : again_q + 1'b1;
    end
    if (state == StOwn && dut.echo_done) good_q <= dut.g_echo.echo_class == ErrOk && dut.g_echo.echo_data == call_q;
    if (att) judged_q <= 1'b1;
    if (dut.rx_first) delay_q <= 16'(own_q) - 16'(Delay);
    if (live_q && !rst_i) begin
      Start_A:   assert (!sent || dut.babble_end || served_q || since + 1 >= need);
      Exact_A:   assert (!sent || dut.babble_end || served_q || !offered || since + 1 == need ||
                         (since + 1 > need && dec_q == 2'd2 && gap_q == GapIsErr));  // quiet long before the decision
      Busy_A:    assert (!sent || (!dut.tx_busy && enable_i));
      Owed_A:    assert (!res || open_q);
      Taken_A:   assert (!taken || !open_q);
      Abort_A:   assert (!open_q || enable_i || (res && last == ErrAborted));
      Pair_A:    assert (!(res && taken));
      Babble_A:  assert (wait_q < 14'(Babble));
      Repeat_A:  assert (!repeated || (sent && open_q));
      Silence_A: assert (!res || last != ErrNoResponse || int'(own_q) == Timeout + Delay);
      Early_A:   assert (!res || last != ErrEarly || int'(own_q) < 12 * 8 + Delay);
      // RX-014, and what a call that was not spoilt gives
      Bad_A:     assert (!dut.attempt_done || (dut.attempt_class == ErrBadMaster) == !good_q);
      Heard_A:   assert (!dut.attempt_done || !good_q || dut.attempt_class == (
                         state == StEarly ? ErrEarly : state == StReceive ? dut.rx_class :
                         quiet_ok_q ? ErrOk : ErrNoResponse));
      Listen2_A: assert (dut.echo_en == ((state == StTx && tx_t >= Delay) || state == StOwn));
      Last_A:    assert (!res || last == (enable_i ? dut.attempt_class : ErrAborted));
      Count_A:   assert (!res || repeats == again_q);
      End_A:     assert (!(dut.attempt_done && enable_i) ||
                         res == (dut.attempt_class == ErrOk || again_q == retries_q));
      // ST-001, ST-003
      Att_A:     assert (att == (dut.attempt_done && enable_i && !quiet_ok_q));
      Once_A:    assert (!(att && judged_q));
      Each_A:    assert (!repeated || quiet_ok_q || judged_q);
      AttIs_A:   assert (!att || (att_index == {sel_q, call_q[9:5]} && att_class == dut.attempt_class &&
                                  att_repeat == (again_q != '0) && att_final == res && (!res || last == att_class)));
      AttAt_A:   assert (!att || state != StReceive || (att_delay == delay_q && int'(delay_q) >= 96 &&
                                                         int'(delay_q) <= Timeout));
      Strobes_A: assert (strobe_n == dut.n_start && strobe_p == dut.p_start);
    end
    if (live_q) begin
      // every wait has an end: from the own last edge to the decision, and in each gap
      Decide_A:  assert (!(state inside {StOwn, StEarly, StListen, StReceive}) ||
                         int'(own_q) <= Timeout + Delay + Answer);
      Gap_A:     assert (!(state inside {StGapOk, StGapNorsp}) || since < need);
      // for the induction
      Known_A:   assert (state <= StGapErr);
      Open_A:    assert (dut.open_q == open_q);
      Phase_A:   assert (!(state inside {StTx, StOwn, StEarly, StListen, StReceive}) || open_q);
      Tx_A:      assert (state != StTx || (dut.i_tx.state_q != 2'd0 &&
                         !(dut.i_tx.state_q == 2'd1 && dut.i_tx.bits_q == '0 && dut.i_tx.cnt_q != '0)));
      TxEnd_A:   assert ((dut.i_tx.state_q != 2'd2 || dut.i_tx.bits_q != '0) &&
                         (dut.i_tx.state_q == 2'd2 || (dut.i_tx.state_q == 2'd1 && dut.i_tx.bits_q != '0) || man));
      TxState_A: assert (dut.i_tx.state_q != 2'd3 && dut.i_tx.cnt_q < 5'd24 && (dut.i_tx.state_q == 2'd0 || en));
      TxOver_A:  assert (state == StTx || state == StOff || dut.i_tx.state_q == 2'd0 ||
                         (state == StOwn && dut.i_tx.state_q == 2'd1 && dut.i_tx.bits_q == '0 &&
                          dut.i_tx.cnt_q == 5'(own_q) && own_q <= 11'd23));
      Own_A:     assert (!(state inside {StOwn, StEarly, StListen}) || own_q >= 11'd1);
      OwnTime_A: assert (state != StOwn || (10'(own_q) == dut.time_q && int'(own_q) <= EchoEnd + Delay));
      Opens_A:   assert (state != StEarly || (10'(own_q) == dut.time_q && int'(own_q) >= 60 + Delay + 1 &&
                         own_q <= 11'd103));
      TxTime_A:  assert (state != StTx || (int'(dut.time_q) == tx_t && tx_t <= Request));
      // the second receiver: at rest until the own first edge, never decided before the last one
      EchoWas_A: assert (state != StTx || tx_t < 1 || tx_t > Delay || !dut.g_echo.i_echo.state_q);
      EchoTx_A:  assert (state != StTx || tx_t <= Delay || !dut.g_echo.i_echo.state_q ||
                         (echo_t >= 1 && echo_t <= tx_t - Delay));
      EchoOwn_A: assert (state != StOwn || !dut.g_echo.i_echo.state_q ||
                         (echo_t >= 1 && echo_t <= int'(own_q) + Request - Delay && echo_t <= Echo));
      EchoPh_A:  assert (!echo_on || dut.g_echo.i_echo.ph_q < 5'd24);
      EchoEnd_A: assert (!echo_on || !(dut.g_echo.i_echo.win_q > 5'd26 || (dut.g_echo.i_echo.win_q == 5'd26 &&
                         (dut.g_echo.i_echo.ph_q > 5'd19 || dut.g_echo.i_echo.seen_q))) ||
                         dut.g_echo.i_echo.ended_q || dut.g_echo.i_echo.info_q || dut.g_echo.i_echo.timing_q);
      EchoSeen_A: assert (!echo_on || dut.g_echo.i_echo.ph_q <= 5'd19 || !dut.g_echo.i_echo.seen_q ||
                         dut.g_echo.i_echo.timing_q || dut.g_echo.i_echo.ended_q);
      Verdict_A: assert (!(state inside {StEarly, StListen, StReceive}) || dut.bad_q == !good_q);
      Fresh_A:   assert (!(state inside {StTx, StOwn}) || !good_q);
      Kept_A:    assert (!open_q || (dut.call_q == call_q && dut.sel_q == sel_q && dut.retries_q == retries_q &&
                                     dut.no_reply_q == quiet_ok_q && dut.repeats_q == again_q));
      Judged_A:  assert (!open_q || judged_q == (!quiet_ok_q &&
                         !(state inside {StTx, StOwn, StEarly, StListen, StReceive})));
      AttTime_A: assert (state != StReceive || (dut.delay_q == 10'(delay_q) && int'(delay_q) >= 96 &&
                         int'(delay_q) <= Timeout));
      Listen_A:  assert (state != StListen || (10'(own_q) == dut.time_q && own_q >= 11'd104 &&
                         own_q <= 11'(Timeout + Delay)));
      Rx_A:      assert (state == StOff || (dut.i_rx.state_q == (state == StReceive)));
      RxTime_A:  assert (state != StReceive || (rx_t >= 1 && rx_t <= Answer && dut.i_rx.ph_q < 5'd24 &&
                         int'(own_q) <= Timeout + Delay + rx_t));
      RxQuiet_A: assert (state != StReceive || (dut.time_q == 10'(quiet_q) && int'(quiet_q) <= Delay + rx_t));
      RxEnd_A:   assert (state != StReceive || !dut.i_rx.ended_q ||
                         (rx_t >= 282 && int'(quiet_q) <= rx_t - 281 + Delay));
      RxPast_A:  assert (state != StReceive || !(dut.i_rx.win_q > 4'd12 || (dut.i_rx.win_q == 4'd12 &&
                         (dut.i_rx.ph_q > 5'd19 || dut.i_rx.seen_q))) ||
                         dut.i_rx.ended_q || dut.i_rx.info_q || dut.i_rx.timing_q);
      RxSeen_A:  assert (state != StReceive || dut.i_rx.ph_q <= 5'd19 || !dut.i_rx.seen_q || dut.i_rx.timing_q ||
                         dut.i_rx.ended_q);
      NotOpen_A: assert (!open_q || !(state inside {StOff, StIdle, StReady}));
      Left_A:    assert (!open_q || (state inside {StTx, StOwn, StEarly, StListen, StReceive}) ||
                         dut.repeats_q < dut.retries_q);
      Repeats_A: assert (!open_q || dut.repeats_q <= dut.retries_q);
      Entry_A:   assert (dec_q != 2'd1 || (state == StGapOk ? since <= Answer - 281 + Delay + 1 :
                         state != StGapNorsp || since == Timeout + Delay + 1));
      GapIs_A:   assert ((state != StGapOk || gap_q == GapIsOk) && (state != StGapNorsp || gap_q == GapIsNorsp) &&
                         (state != StGapErr || gap_q == GapIsErr) && (state != StIdle || gap_q == GapIsIdle));
      Timer_A:   assert (!(state inside {StGapOk, StGapNorsp, StGapErr, StIdle}) ||
                         (int'(dut.time_q) == since && (since < need ||
                          (state == StGapErr && dec_q <= 2'd2 && since <= Answer + Delay + int'(dec_q)))));
      Armed_A:   assert (!dut.armed_q || state == StOff || (state inside {StGapOk, StGapNorsp, StGapErr, StIdle} &&
                         since > need - 96 - 2));
      Arms_A:    assert (!(state inside {StGapOk, StGapNorsp, StGapErr, StIdle}) || dut.armed_q ||
                         since <= need - 96 - 2 || dec_q == 2'd1);
      Lead_A:    assert (state != StReady || (!offered_q && dut.time_q <= 10'd96));  // P_TX_BIAS, then it starts
      Ready_A:   assert (state != StReady || since + 1 >= need || served_q);
      Wait_A:    assert (int'(dut.babble_q) == int'(wait_q));
      Waited_A:  assert ((state inside {StIdle, StGapErr}) ? int'(wait_q) <= Babble - 2 : wait_q == '0);
    end
  end
endmodule
