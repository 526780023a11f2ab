// SPDX-License-Identifier: Apache-2.0
// asi_seq: runs whole AS-i cycles and batches from the link RAM, without firmware between two telegrams.
// Contract: docs/architecture.md ("asi_seq"); words: rdl/asi.rdl; requirements LK-001 .. LK-021.
//
// One call:  offer -> (while it is on the line: search the next slot) -> result -> books -> next offer.
// The search therefore never stretches a gap: from the result to the next offer it takes a constant number of clocks
// per kind of step (at most MaxOfferClocks), whatever slots are active. It knows only the slots as they were when the
// present call was offered: a slot that firmware switches on or off counts at the latest one call of its own later.
// A number's A and B index take turns among those that are callable: active and streak < FailCycles.
// A DEXG's output nibble is fetched in the clock before its offer. Between the clock in which a result is taken up and
// this fetch the memory port is never free, so a live slot is called with what the core has written by that clock.
module asi_seq
  import asi_map_pkg::*;
#(
  parameter int unsigned DexgRetry  = 1,  // P_DEXG_RETRY, 0..3: immediate repetitions of a failed DEXG
  parameter int unsigned FailCycles = 3   // P_FAIL_CYCLES, 1..7: failed cycles in a row until a slave is lost
) (
  input  logic        clk_i, rst_i,       // rst_i: synchronous, active high
  // link RAM, word addresses; read data one clock after the request; this port always wins
  output logic        mem_req_o, mem_we_o,
  output logic [7:0]  mem_addr_o,
  output logic [31:0] mem_wdata_o,
  input  logic [31:0] mem_rdata_i,
  // asi_xact
  output logic        req_valid_o,
  input  logic        req_ready_i,
  output logic [10:0] req_call_o,
  output logic [1:0]  req_retries_o,
  output logic        req_no_reply_o,
  output logic        req_sel_o,          // the call is for a B slave; nothing here depends on it
  input  logic        res_valid_i,        // pulse: the accepted call is over
  input  logic [3:0]  res_last_i, res_first_i, res_data_i,
  input  logic [1:0]  res_repeats_i,
  input  logic        sent_i, repeat_i,   // pulse per request on the line; repeat_i with it: a repetition
  // control
  input  logic        enable_i,           // 0: no new call; the open one comes back as ABORTED
  input  logic        cycle_en_i,         // 1: cycles back to back; 0: stop after the present one
  input  logic        two_extra_i, out_hold_i,
  input  logic        read_id_i,          // slots are called with RDID instead of DEXG; taken at each offer
  input  logic [12:0] min_cycle_us_i,
  input  logic        tick_us_i,          // pulse each microsecond
  input  logic        batch_start_i,      // pulse; ignored while something runs
  input  logic [6:0]  batch_len_i,        // 1..64, taken one clock after batch_start_i
  // status
  output logic        batch_busy_o, cycle_busy_o,
  output logic        batch_done_o, cycle_done_o, slave_lost_o,  // pulses
  output logic        exchange_done_o,    // pulse: the cycle's last DEXG is booked, the extra slots follow
  output logic [2:0]  slot_phase_o,       // phase_e while a cycle runs, right from before the request's first edge
  output logic        sync_o              // one clock, with the first sent_i of a cycle
);
  localparam int unsigned EmptyUs = 160;  // pace of cycles without a telegram: 150 us, rounded up to a cheap compare

  // Word addresses. The four images are neighbours, and so are the single words: their addresses are wiring.
  localparam logic [2:0] AddrImages = 3'(LinkOutImg >> 7);      // {AddrImages, in, copy, word}
  localparam logic [5:0] AddrExtra  = 6'(LinkMgmtReq >> 4);     // {AddrExtra, inclusion, result}
  localparam logic [5:0] AddrCount  = 6'(LinkSent >> 4);        // {AddrCount, counter}
  localparam logic [1:0] AddrSlot  = 2'(LinkSlot >> 8), AddrState = 2'(LinkSlotState >> 8);  // {.., index}
  localparam logic [1:0] AddrBatch = 2'(LinkBatch >> 8);
  localparam logic [1:0] CountSent = 2'd0, CountRepeated = 2'd1, CountFailed = 2'd2, CountCycles = 2'd3;

  typedef enum logic [1:0] {KindDexg, KindMgmt, KindIncl, KindBatch} kind_e;
  typedef enum logic [4:0] {
    StIdle, StBatchLen, StBatchRd, StBatchLd, StScan, StWait, StTally, StStateRd, StResWr, StInRd, StInWr, StFailRd,
    StFailWr, StFetch, StLoad, StCopy, StMgmtReq, StMgmtRes, StIncl, StPick, StCycRd, StCycWr, StPace
  } state_e;

  state_e      state_d, state_q;
  kind_e       kind_d, kind_q;              // the present (or last) call
  logic [5:0]  cur_d, cur_q;                // index of the present DEXG; batch: next request
  logic [5:0]  nxt_d, nxt_q;                // index of the next DEXG; batch: number of requests (0 = 64)
  logic        nxt_v_d, nxt_v_q;            // there is a next DEXG ...
  logic        wrap_d, wrap_q;              // ... and it belongs to the next cycle
  logic        a_d, a_q, b_d, b_q;          // search: callable
  logic [1:0]  opt_d, opt_q, opt_b_d, opt_b_q;  // search: {live, extended} of A, of B; then of the next DEXG
  logic [3:0]  cnt_d, cnt_q;                // step of the search; of a copy: {word, write}
  logic        snap_d, snap_q;              // this cycle's output snapshot is still to be taken
  logic        odd_d, odd_q;                // odd cycle: B's turn
  logic        first_d, first_q;            // the cycle has sent nothing yet
  logic        open_d, open_q;              // a call is offered or on the line
  logic        valid_d, valid_q;            // ... offered
  logic [10:0] call_d, call_q;
  logic        no_reply_d, no_reply_q, sel_d, sel_q;
  logic [1:0]  retries_d, retries_q;
  logic [7:0]  tag_d, tag_q;                // DEXG: {I3..I0 as sent, 0}
  logic        pend_d, pend_q;              // a management request is pending
  logic        was_mgmt_d, was_mgmt_q;      // the last extra slot was a management slot
  logic        lost_d, lost_q;
  logic        sent_d, sent_q, again_d, again_q;  // SENT, REPEATED still to be counted
  logic        res_d, res_q;                // a result waits
  logic [3:0]  last_d, last_q, rfirst_d, rfirst_q, data_d, data_q;
  logic [1:0]  repeats_d, repeats_q;
  logic [12:0] us_d, us_q;                  // time since the cycle's first request
  logic        paced_d, paced_q;            // the cycle has lasted long enough

  // ------------------------------------------------------------------------------------------ what a result means
  logic       is_dexg, is_batch, ok, aborted, failed, gone;
  logic [3:0] answer;
  logic [2:0] streak, streak_inc;
  assign is_dexg    = kind_q == KindDexg;
  assign is_batch   = kind_q == KindBatch;
  assign ok         = last_q == ErrOk;
  assign aborted    = last_q == ErrAborted;
  assign failed     = !ok && !aborted;
  assign answer     = ok ? data_q : 4'd0;
  assign streak     = mem_rdata_i[SlotStateStreakLsb +: SlotStateStreakW];
  assign streak_inc = streak + 3'd1;
  assign gone       = streak >= 3'(FailCycles);

  // ------------------------------------------------------------------------------------------ write data
  // read word + inc (copy: 0, counters: 1), nibbles replaced where a result is written. SLOT_STATE.calls counts in the
  // same adder, and stands alone there: nothing is carried into it.
  logic        inc, inc_calls;
  logic [7:0]  put;  // nibbles to replace
  logic [31:0] sum;
  logic [23:0] book; // SLOT_STATE or a result word
  assign sum  = mem_rdata_i + {3'd0, inc_calls, 27'd0, inc};
  assign book = {tag_q[7:4], !is_dexg ? tag_q[3:0] : ok ? 4'd0 : {1'b0, aborted ? streak : streak_inc},
                 2'b00, repeats_q, rfirst_q, last_q, answer};
  always_comb begin
    put = '0;
    // a failing slave keeps its last valid answer; an aborted call counts for nothing
    if (state_q == StResWr) put = {!is_dexg, 1'b1, !is_dexg || !aborted, 4'hF, !is_dexg || ok};
    if (state_q == StInWr)  put[cur_q[2:0]] = ok || lost_q;
    for (int k = 0; k < 8; k++) begin
      mem_wdata_o[4*k +: 4] = sum[4*k +: 4];
      if (put[k]) mem_wdata_o[4*k +: 4] = state_q == StInWr ? answer : k < 6 ? book[4*(k%6) +: 4] : 4'd0;
    end
  end

  // ------------------------------------------------------------------------------------------ sequence
  logic       do_mgmt, do_incl, sel, load, load_dexg, offer;
  logic [3:0] nibble, info;  // output of the next slot; I3..I0 of its call
  logic       ext, live;     // options of the next slot
  assign {live, ext} = opt_q;
  assign nibble  = mem_rdata_i[4*nxt_q[2:0] +: 4];
  assign info    = read_id_i ? {nxt_q[5], 3'b001} : {ext ? !nxt_q[5] : nibble[3], nibble[2:0]};
  assign do_mgmt = pend_q && !(was_mgmt_q && mem_rdata_i[RequestValidLsb] && !two_extra_i);
  assign do_incl = !do_mgmt && mem_rdata_i[RequestValidLsb];
  assign sel     = b_q && !gone && (!a_q || (odd_q ^ wrap_q));  // last step of the search: rdata is B's state

  always_comb begin
    state_d = state_q;  kind_d = kind_q;  cur_d = cur_q;  nxt_d = nxt_q;  nxt_v_d = nxt_v_q;  wrap_d = wrap_q;
    a_d = a_q;  b_d = b_q;  opt_d = opt_q;  opt_b_d = opt_b_q;  cnt_d = cnt_q;  snap_d = snap_q;  odd_d = odd_q;
    first_d = first_q && !sent_i;  open_d = open_q;  valid_d = valid_q && !(req_ready_i && enable_i);
    pend_d = pend_q;  was_mgmt_d = was_mgmt_q;  lost_d = lost_q;
    sent_d = sent_q || sent_i;  again_d = again_q || (sent_i && repeat_i);
    res_d = res_q || res_valid_i;
    {last_d, rfirst_d, data_d, repeats_d} = {last_q, rfirst_q, data_q, repeats_q};
    if (res_valid_i) {last_d, rfirst_d, data_d, repeats_d} = {res_last_i, res_first_i, res_data_i, res_repeats_i};
    us_d    = sync_o ? '0 : us_q + 13'(tick_us_i);
    paced_d = !sync_o && (paced_q || (tick_us_i && us_q >= min_cycle_us_i && (!first_q || us_q >= 13'(EmptyUs))));
    mem_req_o = 1'b0;  mem_we_o = 1'b0;  mem_addr_o = {AddrCount, CountSent};
    inc = 1'b0;  inc_calls = 1'b0;  load = 1'b0;  load_dexg = 1'b0;  offer = 1'b0;
    batch_done_o = 1'b0;  cycle_done_o = 1'b0;  slave_lost_o = 1'b0;  exchange_done_o = 1'b0;

    unique case (state_q)
      // StIdle: nothing runs
      StIdle: begin
        first_d = 1'b0;  paced_d = 1'b1;
        cur_d = '0;  nxt_d = 6'd1;  wrap_d = 1'b0;  cnt_d = '0;
        if (batch_start_i)               begin state_d = StBatchLen; kind_d = KindBatch; end
        else if (cycle_en_i && enable_i) begin state_d = StScan;     kind_d = KindDexg;  end
      end

      // ---- batch
      // StBatchLen: an empty batch is over at once
      StBatchLen: begin
        nxt_d = batch_len_i[5:0];
        state_d = StBatchRd;
        if (batch_len_i == '0) begin batch_done_o = 1'b1; state_d = StIdle; end
      end
      StBatchRd: begin mem_req_o = 1'b1; mem_addr_o = {AddrBatch, cur_q}; state_d = StBatchLd; end
      StBatchLd: begin load = 1'b1; offer = 1'b1; state_d = StWait; end

      // ---- search, while a call is on the line: numbers after the present one, then those of the next cycle.
      // StScan: five clocks per number: read SLOT A, STATE A, SLOT B, STATE B, decide. Number 0 is the wrap.
      StScan: begin
        mem_req_o  = 1'b1;
        mem_addr_o = {cnt_q[0] ? AddrState : AddrSlot, cnt_q[1], nxt_q[4:0]};
        cnt_d      = cnt_q + 4'd1;
        case (cnt_q[2:0])
          3'd0: if (nxt_q[4:0] == '0) begin
            nxt_d = 6'd1;  wrap_d = 1'b1;  cnt_d = '0;
            if (wrap_q) begin nxt_v_d = 1'b0; state_d = open_q ? StWait : StPace; end
          end
          3'd1: {opt_d, a_d} = {mem_rdata_i[SlotLiveLsb], mem_rdata_i[SlotExtendedLsb], mem_rdata_i[SlotActiveLsb]};
          3'd2: a_d = a_q && !gone;
          3'd3: {opt_b_d, b_d} = {mem_rdata_i[SlotLiveLsb], mem_rdata_i[SlotExtendedLsb], mem_rdata_i[SlotActiveLsb]};
          default: begin
            mem_req_o = 1'b0;
            cnt_d     = '0;
            if (a_q || (b_q && !gone)) begin
              nxt_d[5] = sel;  nxt_v_d = 1'b1;  opt_d = sel ? opt_b_q : opt_q;
              state_d  = open_q ? StWait : StPace;
            end else nxt_d[4:0] = nxt_q[4:0] + 5'd1;
          end
        endcase
      end

      // StWait: the call is on the line. Counters first, so that they are exact when the result is booked.
      StWait: begin
        mem_addr_o = {AddrCount, sent_q ? CountSent : CountRepeated};
        if (sent_q || again_q) begin mem_req_o = 1'b1; state_d = StTally; end
        else if (res_q) begin
          res_d = 1'b0;  open_d = 1'b0;
          state_d = is_dexg ? StStateRd : StResWr;
        end else if (valid_q && !enable_i) begin  // not accepted in time: withdrawn
          valid_d = 1'b0;  res_d = 1'b1;
          {last_d, rfirst_d, repeats_d} = {ErrAborted, ErrAborted, 2'd0};
        end
      end
      StTally: begin
        mem_req_o = 1'b1;  mem_we_o = 1'b1;  inc = 1'b1;
        mem_addr_o = {AddrCount, sent_q ? CountSent : CountRepeated};
        if (sent_q) sent_d = sent_i; else again_d = sent_i && repeat_i;
        state_d = StWait;
      end

      // ---- books of one result: SLOT_STATE or the result word, IN_WORK, FAILED
      StStateRd: begin mem_req_o = 1'b1; mem_addr_o = {AddrState, cur_q}; state_d = StResWr; end
      StResWr: begin
        mem_req_o = 1'b1;  mem_we_o = 1'b1;  inc_calls = !aborted;
        unique case (kind_q)
          KindDexg:  mem_addr_o = {AddrState, cur_q};
          KindBatch: mem_addr_o = {AddrBatch, cur_q};
          default:   mem_addr_o = {AddrExtra, kind_q == KindIncl, 1'b1};
        endcase
        lost_d  = failed && streak_inc == 3'(FailCycles);
        if (is_batch) cur_d = cur_q + 6'd1;
        state_d = is_dexg ? StInRd : StFailRd;
      end
      StInRd: begin mem_req_o = 1'b1; mem_addr_o = {AddrImages, 2'b10, cur_q[5:3]}; state_d = StInWr; end
      StInWr: begin
        mem_req_o = 1'b1;  mem_we_o = 1'b1;  mem_addr_o = {AddrImages, 2'b10, cur_q[5:3]};
        slave_lost_o = lost_q;
        if (lost_q && cur_q == nxt_q) nxt_v_d = 1'b0;  // the search came before this result: the only slave is lost
        state_d = StFailRd;
      end
      StFailRd: begin mem_req_o = 1'b1; mem_addr_o = {AddrCount, CountFailed}; state_d = StFailWr; end
      StFailWr: begin
        mem_req_o = 1'b1;  mem_we_o = 1'b1;  mem_addr_o = {AddrCount, CountFailed};  inc = failed;
        if (is_batch) begin
          state_d = StBatchRd;
          if (cur_q == nxt_q) begin batch_done_o = 1'b1; state_d = StIdle; end
        end
        else if (aborted || !enable_i)              state_d = StIdle;  // the cycle ends without publication
        else if (is_dexg && nxt_v_q && !wrap_q)     state_d = StFetch;
        else if (is_dexg)                           begin exchange_done_o = 1'b1; state_d = StMgmtReq; end
        else if (kind_q == KindMgmt && two_extra_i) state_d = StIncl;
        else                                        state_d = StCopy;
      end

      // ---- next DEXG
      // StFetch: output nibble, of a live slot from OUT_IMG. A cycle's first one comes from OUT_IMG as well; the
      // snapshot follows without a free clock for the core, so both are of one moment; the offer is 15 clocks earlier.
      StFetch: begin
        mem_req_o = 1'b1;  mem_addr_o = {AddrImages, 1'b0, !(snap_q || live), nxt_q[5:3]};
        state_d = StLoad;
      end
      StLoad: begin
        state_d = StMgmtReq;
        if (nxt_v_q) begin
          load_dexg = 1'b1;  offer = 1'b1;  kind_d = KindDexg;
          cur_d = nxt_q;  nxt_d[4:0] = nxt_q[4:0] + 5'd1;  wrap_d = 1'b0;
          mem_req_o = snap_q;  mem_addr_o = {AddrImages, 5'd0};
          cnt_d = {3'd0, snap_q};
          state_d = snap_q ? StCopy : StScan;
        end
      end
      // StCopy: eight words: OUT_IMG to OUT_SNAP at the start of a cycle, IN_WORK to IN_IMG at its end
      StCopy: begin
        mem_req_o = 1'b1;  mem_we_o = cnt_q[0];  mem_addr_o = {AddrImages, !snap_q, cnt_q[0], cnt_q[3:1]};
        cnt_d = cnt_q + 4'd1;
        if (cnt_q == '1) begin
          snap_d = 1'b0;
          if (open_q)       state_d = StScan;
          else if (!snap_q) state_d = StCycRd;  // else: an empty cycle goes on to its end
        end
      end

      // ---- extra slots: read as late as possible
      StMgmtReq: begin mem_req_o = 1'b1; mem_addr_o = {AddrExtra, 2'b00}; state_d = StMgmtRes; end
      StMgmtRes: begin mem_req_o = 1'b1; mem_addr_o = {AddrExtra, 2'b01}; load = 1'b1; state_d = StIncl; end
      StIncl: begin
        mem_req_o = 1'b1;  mem_addr_o = {AddrExtra, 2'b10};
        pend_d  = is_dexg && tag_q != mem_rdata_i[ResultTagLsb +: ResultTagW];  // not after the management call
        state_d = StPick;
      end
      StPick: begin
        was_mgmt_d = do_mgmt;
        load  = do_incl;
        offer = do_mgmt || do_incl;
        state_d = StCopy;
        if (offer) begin
          kind_d = do_mgmt ? KindMgmt : KindIncl;
          nxt_d[4:0] = '0;  wrap_d = 1'b0;  // search in the next cycle
          if (!snap_q) state_d = StScan;
        end
      end

      // ---- end of the cycle
      StCycRd: begin mem_req_o = 1'b1; mem_addr_o = {AddrCount, CountCycles}; state_d = StCycWr; end
      StCycWr: begin
        mem_req_o = 1'b1;  mem_we_o = 1'b1;  mem_addr_o = {AddrCount, CountCycles};  inc = 1'b1;
        cycle_done_o = 1'b1;
        odd_d   = !odd_q;
        state_d = StPace;
      end
      // StPace: the next cycle starts here, or the wait for it
      StPace:
        if (!cycle_en_i || !enable_i) state_d = StIdle;
        else if (paced_q) begin
          first_d = !first_q;
          if (first_q) begin  // nothing was sent, so nothing was searched: it is done now
            nxt_d = 6'd1;  wrap_d = 1'b0;  state_d = StScan;
          end else begin
            snap_d = !out_hold_i;  kind_d = KindDexg;  us_d = '0;  paced_d = 1'b0;  state_d = StFetch;
          end
        end
      default: state_d = StIdle;
    endcase

    // request registers
    call_d = call_q;  sel_d = sel_q;  no_reply_d = no_reply_q;  retries_d = retries_q;  tag_d = tag_q;
    if (load) begin
      call_d     = mem_rdata_i[RequestCallLsb +: RequestCallW];
      sel_d      = mem_rdata_i[RequestSelLsb];
      no_reply_d = mem_rdata_i[RequestNoReplyLsb];
      retries_d  = mem_rdata_i[RequestRetriesLsb +: RequestRetriesW];
      tag_d      = mem_rdata_i[RequestTagLsb +: RequestTagW];
    end
    if (load_dexg) begin
      call_d     = {read_id_i, nxt_q[4:0], read_id_i, info};
      sel_d      = nxt_q[5];
      no_reply_d = 1'b0;
      retries_d  = 2'(DexgRetry);
      tag_d      = {info, 4'd0};
    end
    if (offer) begin valid_d = 1'b1; open_d = 1'b1; end
  end

  assign req_valid_o    = valid_q && enable_i;
  assign req_call_o     = call_q;
  assign req_retries_o  = retries_q;
  assign req_no_reply_o = no_reply_q;
  assign req_sel_o      = sel_q;
  assign batch_busy_o   = state_q != StIdle && is_batch;
  assign cycle_busy_o   = state_q != StIdle && !is_batch;
  assign sync_o         = sent_i && first_q && !repeat_i;
  assign slot_phase_o   = kind_q == KindMgmt ? PhaseManagement :
                          kind_q == KindIncl ? PhaseInclusion : PhaseDataExchange;

  always_ff @(posedge clk_i) begin
    state_q <= rst_i ? StIdle : state_d;
    odd_q   <= rst_i ? 1'b0 : odd_d;
    valid_q <= rst_i ? 1'b0 : valid_d;
    open_q  <= rst_i ? 1'b0 : open_d;
    res_q   <= rst_i ? 1'b0 : res_d;
    sent_q  <= rst_i ? 1'b0 : sent_d;
    again_q <= rst_i ? 1'b0 : again_d;
    snap_q  <= rst_i ? 1'b0 : snap_d;
    first_q <= rst_i ? 1'b0 : first_d;
    was_mgmt_q <= rst_i ? 1'b0 : was_mgmt_d;
    // no reset needed: StIdle or the step that uses them sets these
    {kind_q, cur_q, nxt_q, nxt_v_q, wrap_q, cnt_q} <= {kind_d, cur_d, nxt_d, nxt_v_d, wrap_d, cnt_d};
    {a_q, b_q, opt_q, opt_b_q, pend_q, lost_q} <= {a_d, b_d, opt_d, opt_b_d, pend_d, lost_d};
    {call_q, sel_q, no_reply_q, retries_q, tag_q} <= {call_d, sel_d, no_reply_d, retries_d, tag_d};
    {last_q, rfirst_q, data_q, repeats_q} <= {last_d, rfirst_d, data_d, repeats_d};
    {us_q, paced_q} <= {us_d, paced_d};
  end

`ifndef SYNTHESIS
  // MaxOfferClocks: from a result that the sequencer waits for to the next offer. 11 to the next DEXG, 33 from the last
  // DEXG over publication to the next cycle, 37 if in those clocks the only slave is lost and firmware adds an extra
  // request. The shortest gap after a result is 48 clocks (P_GAP_NORSP at 8 MHz).
  localparam int unsigned MaxOfferClocks = 38;
  int unsigned since_q;
  logic        timed_q;
  logic [14:0] offered_q;  // the request may not change while it is offered
  logic        held_q;
  logic        begun;      // a cycle begins; for the test bench
  assign begun = state_q == StPace && state_d == StFetch;
  always_ff @(posedge clk_i) begin
    // ends with the offer, with a wait on purpose, and where a cycle without any telegram begins
    timed_q <= !rst_i && (timed_q ? !valid_q && state_q != StIdle && !(state_q == StPace && !paced_q) &&
                                    !(state_q == StPick && !offer && first_q)
                                  : res_valid_i && state_q == StWait && !sent_q && !again_q);
    since_q <= timed_q ? since_q + 1 : 1;
    held_q    <= !rst_i && req_valid_o && !req_ready_i;
    offered_q <= {call_q, sel_q, retries_q, no_reply_q};
    if (!rst_i) begin
      Offer_A:    assert (!timed_q || since_q <= MaxOfferClocks);
      Held_A:     assert (!held_q || !enable_i || (req_valid_o && offered_q == {call_q, sel_q, retries_q, no_reply_q}));
      OneCall_A:  assert (!offer || !open_q);
      Result_A:   assert (!res_valid_i || (open_q && !valid_q && !res_q));
      Books_A:    assert (!res_q || state_q inside {StScan, StCopy, StLoad, StWait, StTally});
      Tally_A:    assert (!sent_i || !sent_q);          // no request is left uncounted
      Index_A:    assert (!load_dexg || nxt_q[4:0] != '0);
      Write_A:    assert (!mem_we_o || mem_req_o);
      Atomic_A:   assert (state_q != StCopy || mem_req_o);  // no free clock for the core inside a copy
      Events_A:   assert (!(cycle_done_o && is_batch) && !(batch_done_o && !is_batch));
      Published_A: assert (!cycle_done_o || !open_q);
      Exchange_A: assert (!exchange_done_o || (is_dexg && !open_q && !aborted));
      Carry_A:    assert (!inc || !inc_calls);          // SLOT_STATE.calls counts alone
      Begin_C:    cover (begun);
      Lost_C:     cover (slave_lost_o);
      OnlyLost_C: cover (state_q == StInWr && lost_q && cur_q == nxt_q && nxt_v_q);
      Alternate_C: cover (state_q == StPick && pend_q && !do_mgmt);
      Both_C:     cover (state_q == StPick && kind_q == KindMgmt && do_incl);
      Empty_C:    cover (state_q == StPace && paced_q && first_q);
      Hold_C:     cover (state_q == StLoad && nxt_v_q && !snap_q && first_q);
      Withdrawn_C: cover (state_q == StWait && valid_q && !enable_i);
      AbortScan_C: cover (state_q == StScan && res_valid_i);
      Batch_C:    cover (batch_done_o && nxt_q == '0);
      Pace_C:     cover (state_q == StPace && !paced_q);
    end
  end
`endif
endmodule
