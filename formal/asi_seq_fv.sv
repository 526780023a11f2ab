// SPDX-License-Identifier: Apache-2.0
// Proof of asi_seq for any one number 1..31 (LK-001, LK-002, LK-004, LK-008 .. LK-010, LK-013 .. LK-021, CA-001),
// unbounded. The link RAM keeps the words of the watched number, its nibbles of OUT_IMG and OUT_SNAP, and the words of
// the extra slots; every other word reads anything at any time. asi_xact is free within what asi_xact_fv and asi_tx_fv
// guarantee (assumptions Line_*).
// Firmware may write any word in any clock the sequencer leaves free, but MGMT_RES never, and MGMT_REQ not while it is
// pending and a cycle runs.
module asi_seq_fv import asi_map_pkg::*; (
  input logic        clk_i, rst_i,
`ifdef FV_SIM
  input logic [4:0]  n_i,
`endif
  input logic [31:0] free_i,                   // what is read where nothing is watched
  input logic        fw_we_i, input logic [7:0] fw_addr_i, input logic [31:0] fw_data_i,
  input logic        ready_i, res_valid_i, sent_i, repeat_i,
  input logic [3:0]  res_last_i, res_first_i, res_data_i, input logic [1:0] res_repeats_i,
  input logic        enable_i, cycle_en_i, two_extra_i, out_hold_i, read_id_i, tick_us_i, batch_start_i,
  input logic [12:0] min_cycle_us_i, input logic [6:0] batch_len_i
);
  localparam int Attempt = 400;                // clocks from a request to its repetition or result, at least
  localparam int Retry = 1, Fail = 3;          // P_DEXG_RETRY, P_FAIL_CYCLES
  localparam int SearchMax = 328;              // clocks from an offer to the end of the search for the next slot
  localparam int QuitMax = 336, QuitBatch = 450;  // clocks from stop to idle, without an open call
  localparam logic [4:0]
    StIdle = 0, StBatchLen = 1, StBatchRd = 2, StBatchLd = 3, StScan = 4, StWait = 5, StTally = 6, StStateRd = 7,
    StResWr = 8, StInRd = 9, StInWr = 10, StFailRd = 11, StFailWr = 12, StFetch = 13, StLoad = 14, StCopy = 15,
    StMgmtReq = 16, StMgmtRes = 17, StIncl = 18, StPick = 19, StCycRd = 20, StCycWr = 21, StPace = 22;
  localparam logic [7:0] Slot = 8'(LinkSlot / 4), State = 8'(LinkSlotState / 4), Batch = 8'(LinkBatch / 4),
    MgmtReq = 8'(LinkMgmtReq / 4), MgmtRes = 8'(LinkMgmtRes / 4), InclReq = 8'(LinkInclReq / 4),
    InclRes = 8'(LinkInclRes / 4), Sent = 8'(LinkSent / 4), OutImg = 8'(LinkOutImg / 4),
    OutSnap = 8'(LinkOutSnap / 4), InWork = 8'(LinkInWork / 4), InImg = 8'(LinkInImg / 4);

  logic        mem_req, mem_we, req_valid, no_reply, sel, batch_busy, cycle_busy, batch_done, cycle_done, lost, sync;
  logic        exchange_done;
  logic [7:0]  mem_addr;
  logic [31:0] mem_wdata, rdata_q;
  logic [10:0] call;
  logic [1:0]  retries;
  logic [2:0]  phase;
  asi_seq #(.DexgRetry(Retry), .FailCycles(Fail)) dut (
    .clk_i, .rst_i, .mem_req_o(mem_req), .mem_we_o(mem_we), .mem_addr_o(mem_addr), .mem_wdata_o(mem_wdata),
    .mem_rdata_i(rdata_q), .req_valid_o(req_valid), .req_ready_i(ready_i), .req_call_o(call),
    .req_retries_o(retries), .req_no_reply_o(no_reply), .req_sel_o(sel),
    .res_valid_i, .res_last_i, .res_first_i, .res_data_i,
    .res_repeats_i, .sent_i, .repeat_i, .enable_i, .cycle_en_i, .two_extra_i, .out_hold_i, .read_id_i,
    .min_cycle_us_i, .tick_us_i, .batch_start_i, .batch_len_i, .batch_busy_o(batch_busy), .cycle_busy_o(cycle_busy),
    .batch_done_o(batch_done), .cycle_done_o(cycle_done), .slave_lost_o(lost), .exchange_done_o(exchange_done),
    .slot_phase_o(phase), .sync_o(sync)
  );

  // ------------------------------------------------------------------------------------------ link RAM
  logic [4:0]  n_q;                            // the watched number: free at the start, then constant
`ifdef FV_SIM
  assign n_q = n_i;
`else
  always_ff @(posedge clk_i) n_q <= n_q;
`endif
  logic [1:0]  act_q, ext_q, livesl_q;         // its SLOT words: [0] A, [1] B
  logic [2:0]  streak_q [2];                   // its SLOT_STATE words: streak, sent, calls
  logic [3:0]  inf_q [2], num_q [2];
  logic [3:0]  img_q [2], snap_q [2];          // its nibbles of OUT_IMG, OUT_SNAP
  logic [31:0] mreq_q, ireq_q;                 // MGMT_REQ, INCL_REQ
  logic [7:0]  mres_q;                         // MGMT_RES.tag
  logic        fw, fw_slot, fw_mreq, mpend, ivalid;
  logic [31:0] word;
  assign fw      = fw_we_i && !mem_req;        // the sequencer always wins
  assign fw_slot = fw && fw_addr_i[4:0] == n_q && !fw_addr_i[7];  // SLOT and SLOT_STATE, A and B
  assign fw_mreq = fw && fw_addr_i == MgmtReq;
  assign mpend   = mreq_q[RequestTagLsb +: RequestTagW] != mres_q;
  assign ivalid  = ireq_q[RequestValidLsb];
  always_comb begin
    word = free_i;
    for (int b = 0; b < 2; b++) begin
      if (mem_addr == Slot + 8'(32 * b) + 8'(n_q)) begin
        word[SlotActiveLsb] = act_q[b];  word[SlotExtendedLsb] = ext_q[b];  word[SlotLiveLsb] = livesl_q[b];
      end
      if (mem_addr == State + 8'(32 * b) + 8'(n_q)) begin
        word[SlotStateStreakLsb +: SlotStateStreakW] = streak_q[b];
        word[SlotStateSentLsb +: SlotStateSentW]     = inf_q[b];
        word[SlotStateCallsLsb +: SlotStateCallsW]   = num_q[b];
      end
      if (mem_addr == OutImg + 8'(4 * b) + 8'(n_q[4:3]))  word[4*n_q[2:0] +: 4] = img_q[b];
      if (mem_addr == OutSnap + 8'(4 * b) + 8'(n_q[4:3])) word[4*n_q[2:0] +: 4] = snap_q[b];
    end
    if (mem_addr == MgmtReq) word = mreq_q;
    if (mem_addr == InclReq) word = ireq_q;
    if (mem_addr == MgmtRes) word[ResultTagLsb +: ResultTagW] = mres_q;
  end
  always_ff @(posedge clk_i) begin
    rdata_q <= mem_req && !mem_we ? word : free_i;
    for (int b = 0; b < 2; b++) begin
      if (fw_slot && fw_addr_i[6:5] == 2'(b)) begin
        act_q[b] <= fw_data_i[SlotActiveLsb];  ext_q[b] <= fw_data_i[SlotExtendedLsb];
        livesl_q[b] <= fw_data_i[SlotLiveLsb];
      end
      if (fw_slot && fw_addr_i[6:5] == 2'(2 + b)) begin
        streak_q[b] <= fw_data_i[SlotStateStreakLsb +: SlotStateStreakW];
        inf_q[b] <= fw_data_i[SlotStateSentLsb +: SlotStateSentW];
        num_q[b] <= fw_data_i[SlotStateCallsLsb +: SlotStateCallsW];
      end
      if (mem_req && mem_we && mem_addr == State + 8'(32 * b) + 8'(n_q)) begin
        streak_q[b] <= mem_wdata[SlotStateStreakLsb +: SlotStateStreakW];
        inf_q[b] <= mem_wdata[SlotStateSentLsb +: SlotStateSentW];
        num_q[b] <= mem_wdata[SlotStateCallsLsb +: SlotStateCallsW];
      end
      if (fw && fw_addr_i == OutImg + 8'(4 * b) + 8'(n_q[4:3]))                img_q[b]  <= fw_data_i[4*n_q[2:0] +: 4];
      if (fw && fw_addr_i == OutSnap + 8'(4 * b) + 8'(n_q[4:3]))               snap_q[b] <= fw_data_i[4*n_q[2:0] +: 4];
      if (mem_req && mem_we && mem_addr == OutSnap + 8'(4 * b) + 8'(n_q[4:3])) snap_q[b] <= mem_wdata[4*n_q[2:0] +: 4];
    end
    if (fw_mreq) mreq_q <= fw_data_i;
    if (fw && fw_addr_i == InclReq) ireq_q <= fw_data_i;
    if (mem_req && mem_we && mem_addr == MgmtRes) mres_q <= mem_wdata[ResultTagLsb +: ResultTagW];
  end

  // ------------------------------------------------------------------------------------------ what the rules follow
  typedef enum logic [1:0] {KindDexg, KindMgmt, KindIncl, KindBatch} kind_e;
  logic [4:0]  st;
  logic        dexg, mgmt, incl, batch, taken, withdrawn, begun, search, hit, books;
  logic [1:0]  callable;
  logic        now_v, now_b;                   // is the number called, with its B index, in a cycle of parity par_q
  logic        init_q = 1'b1, live_q = 1'b0;
  logic        line_q;                         // a call was taken and has no result
  logic        gone_q;                         // the last call was withdrawn before it was taken
  logic [9:0]  sent_age_q, age_q;              // clocks since the last request; since the last offer
  logic        par_q;                          // parity of the cycle: ends of cycles since reset
  logic        cyc_q;                          // a cycle has begun
  logic [1:0]  calls_q;                        // calls of the number in this cycle
  logic [4:0]  prev_q, pos_q;                  // last number called, offered in this cycle
  logic [2:0]  quiet_q;                        // its words untouched by firmware since the last, ... third last search
  logic        steady_q;                       // ... and since the third last one before the cycle
  logic [1:0]  seen_q;                         // callable at some moment since the present search began
  logic [4:0]  from_q;                         // the present search began after this number
  logic        exp_v_q, exp_b_q;               // what this cycle has to call
  logic        xm_q, xi_q;                     // this cycle has called management, inclusion
  logic        picked_q;                       // this cycle has decided about its (first) extra slot
  logic [1:0]  mage_q, iage_q;                 // ends of cycles a request has been waiting
  logic        mtaken_q;                       // the pending request was called
  logic        mbegin_q, mfree_q, ibegin_q;    // since the cycle began: pending; INCL_REQ not valid; valid
  logic        row_q;                          // management was called, inclusion was valid ever since
  logic        two_q, busy_q;
  logic [31:0] ipick_q;                        // INCL_REQ as it was picked
  logic [3:0]  last_q;                         // the result
  logic [17:0] held, held_q;                   // the request
  logic        offered_q;
  logic [9:0]  quit_q;
  logic [6:0]  done_q, len_q;                  // batch
  logic [13:0] us_q;                           // ticks since the first request of the cycle
  logic [12:0] min_q;
  logic        same_q;                         // min_cycle_us as it was then
  logic        idle_q;                         // nothing has begun since idle
  logic        xd_q;                           // exchange_done came in this cycle
  logic [3:0]  due_q [2];                      // nibble due if it is offered now: OUT_IMG or OUT_SNAP, one clock ago
  logic        rid_q;                          // read_id when the present DEXG was offered
  logic [3:0]  line_info_q;                    // I3..I0 of the last call taken
  logic        mem_state, mem_mres, mem_ires;
  assign mem_state = mem_req && mem_we && mem_addr[7:6] == State[7:6];
  assign mem_mres  = mem_req && mem_we && mem_addr == MgmtRes;
  assign mem_ires  = mem_req && mem_we && mem_addr == InclRes;
  assign held      = {call, sel, retries, no_reply, phase};
  assign st       = dut.state_q;
  assign dexg     = dut.kind_q == KindDexg;
  assign mgmt     = dut.kind_q == KindMgmt;
  assign incl     = dut.kind_q == KindIncl;
  assign batch    = dut.kind_q == KindBatch;
  assign taken    = req_valid && ready_i;
  assign withdrawn = st == StWait && dut.valid_q && !enable_i;
  assign books    = st inside {StStateRd, StResWr, StInRd, StInWr, StFailRd, StFailWr};
  assign begun    = dut.begun;
  assign search   = (dut.offer && !batch) || (st == StIdle && dut.state_d == StScan) ||
                    (st == StPace && dut.state_d == StScan);
  assign hit      = dut.nxt_q[4:0] == n_q;     // the search is at the watched number, or has found it
  assign callable = {act_q[1] && streak_q[1] < Fail, act_q[0] && streak_q[0] < Fail};
  assign now_v    = callable != '0;
  assign now_b    = callable[1] && (!callable[0] || par_q);


  // ------------------------------------------------------------------------------------------ how long it can take
  int scan_left, wait_left, left;              // clocks: search; from StWait to idle; to idle
  logic [4:0] scan_n;
  assign scan_n = dut.nxt_q[4:0];
  always_comb begin
    scan_left = scan_n == '0 ? (dut.wrap_q ? 1 : 157) : 161 - 5 * int'(scan_n) + (dut.wrap_q ? 0 : 156);
    if (st == StScan) scan_left -= int'(dut.cnt_q[2:0]);
    wait_left = 2 * int'(dut.sent_q) + 2 * int'(dut.again_q) + (dut.res_q ? 1 : 2) + (dexg ? 6 : 3);
    if (batch) wait_left += 7 * (int'(len_q) - int'(done_q) - 1);
    case (st)
      StIdle:     left = 0;
      StBatchLen: left = 449;
      StBatchRd:  left = 7 * (int'(len_q) - int'(done_q));
      StBatchLd:  left = 7 * (int'(len_q) - int'(done_q)) - 1;
      StScan:     left = scan_left + (dut.open_q ? wait_left : 1);
      StWait:     left = wait_left;
      StTally:    left = wait_left - 1;
      StStateRd:  left = 6;
      StResWr:    left = dexg ? 5 : batch ? 7 * (int'(len_q) - int'(done_q)) - 4 : 3;
      StInRd:     left = 4;
      StInWr:     left = 3;
      StFailRd:   left = 2 + (batch ? 7 * (int'(len_q) - int'(done_q)) : 0);
      StFailWr:   left = 1 + (batch ? 7 * (int'(len_q) - int'(done_q)) : 0);
      StFetch:    left = 333;
      StLoad:     left = 332;
      StCopy:     left = 16 - int'(dut.cnt_q) + (dut.open_q ? scan_left + wait_left : dut.snap_q ? 19 : 3);
      StMgmtReq:  left = 182;
      StMgmtRes:  left = 181;
      StIncl:     left = 180;
      StPick:     left = 179;
      StCycRd:    left = 3;
      StCycWr:    left = 2;
      default:    left = 1;
    endcase
  end

  // latest clock after a result (asi_seq: since_q) in which a state on the way to the next offer can be
  int offer_at;
  always_comb begin
    case (st)
      StWait:     offer_at = 1;
      StStateRd:  offer_at = 2;
      StResWr:    offer_at = 3;
      StInRd:     offer_at = 4;
      StInWr:     offer_at = 5;
      StFailRd:   offer_at = 6;
      StFailWr:   offer_at = 7;
      StBatchRd:  offer_at = 8;
      StBatchLd:  offer_at = 9;
      StMgmtReq:  offer_at = dut.first_q ? 33 : 8;
      StMgmtRes:  offer_at = dut.first_q ? 34 : 9;
      StIncl:     offer_at = dut.first_q ? 35 : 10;
      StPick:     offer_at = dut.first_q ? 36 : 11;
      StCopy:     offer_at = 12 + int'(dut.cnt_q);
      StCycRd:    offer_at = 28;
      StCycWr:    offer_at = 29;
      StPace:     offer_at = 30;
      StIdle:     offer_at = 31;
      StFetch:    offer_at = dut.first_q ? 31 : 8;
      StLoad:     offer_at = dut.first_q ? 32 : 9;
      default:    offer_at = 0;
    endcase
    if (dut.valid_q) offer_at = 37;
  end

  // the search is over and its finding not yet used
  logic over, passed, extra, target;
  assign over   = !batch && !(st inside {StIdle, StScan, StBatchLen, StBatchRd, StBatchLd}) &&
                  !(st == StCopy && dut.open_q);
  assign passed = dut.wrap_q ? n_q > from_q || n_q < scan_n : n_q > from_q && (n_q < scan_n || scan_n == '0);
  assign target = st inside {StPace, StFetch, StLoad} ? par_q : par_q ^ dut.wrap_q;  // parity of the cycle searched
  // the cycle has called its slots
  assign extra  = cyc_q && (st inside {StMgmtReq, StMgmtRes, StIncl, StPick, StCycRd, StCycWr} || mgmt || incl ||
                            (st == StCopy && !dut.open_q));

  // the search came before the result: the only slave is lost
  logic losing, mgmt_open, mgmt_on, mem_req_q;
  assign losing    = st inside {StInRd, StInWr} && dut.lost_q && dut.cur_q == dut.nxt_q && dut.nxt_v_q;
  assign mgmt_open = mgmt && (dut.open_q || st == StResWr);
  assign mgmt_on   = mgmt && (dut.open_q || st inside {StResWr, StFailRd, StFailWr, StIncl, StPick});

  always_ff @(posedge clk_i) begin
    init_q <= 1'b0;
    if (init_q) assume (rst_i);
    assume (n_q != '0);
    // firmware
    assume (!(fw && fw_addr_i == MgmtRes));
    assume (!fw_mreq || !mpend || !cycle_busy);
    assume (!busy_q || !cycle_busy || two_extra_i == two_q);  // changed only while no cycle runs
    assume (batch_len_i <= 7'd64);
    // asi_xact (Line_*): a taken request starts in the same clock, repetitions only while it is open
    assume (sent_i == (taken || repeat_i));
    assume (!repeat_i || (line_q && enable_i && sent_age_q >= 10'(Attempt)));
    // one result per call taken, after its request was sent, or at once when disabled
    assume (!res_valid_i || line_q);
    assume (!res_valid_i || !sent_i);
    assume (!(res_valid_i && enable_i) || (sent_age_q >= 10'(Attempt) && res_last_i != ErrAborted));
    assume (!(line_q && !enable_i) || (res_valid_i && res_last_i == ErrAborted));

    live_q <= 1'b1;
    mem_req_q <= mem_req;
    two_q  <= two_extra_i;
    busy_q <= cycle_busy && !rst_i;
    line_q <= !rst_i && ((line_q && !res_valid_i) || taken);
    if (rst_i || st == StFailWr) gone_q <= 1'b0;
    else if (withdrawn) gone_q <= 1'b1;
    if (res_valid_i) last_q <= res_last_i;
    else if (withdrawn) last_q <= ErrAborted;
    sent_age_q <= sent_i ? 10'd1 : sent_age_q == '1 ? '1 : sent_age_q + 1'b1;
    age_q      <= dut.offer ? 10'd1 : age_q == '1 ? '1 : age_q + 1'b1;
    par_q      <= !rst_i && (par_q ^ cycle_done);
    cyc_q      <= !rst_i && (begun || (cyc_q && !cycle_done && dut.state_d != StIdle));
    // calls of this cycle
    if (begun) begin
      calls_q <= '0;  prev_q <= '0;  pos_q <= '0;  {xm_q, xi_q, xd_q} <= '0;
      exp_v_q <= now_v;  exp_b_q <= now_b;
    end else begin
      if (taken && dexg && call[9:5] == n_q && calls_q != '1) calls_q <= calls_q + 1'b1;
      if (taken && dexg) prev_q <= call[9:5];
      if (dut.load_dexg) pos_q <= dut.nxt_q[4:0];
      if (exchange_done) xd_q <= 1'b1;
      if (taken && mgmt) xm_q <= 1'b1;
      if (taken && incl) xi_q <= 1'b1;
    end
    // information
    for (int b = 0; b < 2; b++) due_q[b] <= livesl_q[b] || dut.snap_q ? img_q[b] : snap_q[b];
    if (dut.load_dexg) rid_q <= read_id_i;
    if (taken) line_info_q <= call[3:0];
    // searches
    if (rst_i) quiet_q <= '0;
    else if (search) begin
      quiet_q  <= dut.offer ? {quiet_q[1:0] & {2{!fw_slot}}, 1'b1} : '1;  // without a call nothing before counts
      seen_q   <= '0;
      from_q   <= dut.load_dexg ? dut.nxt_q[4:0] : dut.offer ? 5'd31 : 5'd0;
    end else begin
      quiet_q  <= quiet_q & {3{!fw_slot}};
      seen_q   <= seen_q | callable;
    end
    steady_q <= (begun ? quiet_q[2] : steady_q) && !fw_slot;
    // extra slots
    picked_q <= !rst_i && (st == StPick || (picked_q && !cycle_done && dut.state_d != StIdle));
    mage_q   <= rst_i || !mpend || fw_mreq ? '0 : cycle_done && mage_q != '1 ? mage_q + 1'b1 : mage_q;
    iage_q   <= rst_i || !ivalid || (dut.offer && st == StPick && dut.do_incl) ? '0 :
                cycle_done && iage_q != '1 ? iage_q + 1'b1 : iage_q;
    mtaken_q <= !rst_i && !fw_mreq && !mem_mres && (mtaken_q || (taken && mgmt));
    mbegin_q <= !rst_i && (begun || mbegin_q) && mpend && !fw_mreq;
    mfree_q  <= (begun || mfree_q) && !ivalid && !(fw && fw_addr_i == InclReq);
    ibegin_q <= (begun || ibegin_q) && ivalid && !(fw && fw_addr_i == InclReq);
    row_q    <= !rst_i && ((taken && mgmt) || row_q) && ivalid && !two_extra_i && !(st == StPick && dut.do_incl);
    if (st == StPick) ipick_q <= ireq_q;
    // batch, pace
    len_q  <= st == StBatchLen ? batch_len_i : len_q;
    done_q <= st == StBatchLen ? '0 : done_q + 7'(mem_req && mem_we && mem_addr[7:6] == Batch[7:6]);
    us_q   <= begun || sync ? '0 : us_q == '1 ? '1 : us_q + 14'(tick_us_i);
    min_q  <= min_cycle_us_i;
    idle_q <= rst_i || st == StIdle || (idle_q && !begun);
    same_q <= begun || (same_q && min_cycle_us_i == min_q);
    // idle
    quit_q    <= rst_i || cycle_en_i || enable_i || line_q || st == StIdle ? '0 : quit_q + 1'b1;
    offered_q <= !rst_i && req_valid && !ready_i;
    held_q    <= held;

    if (live_q && !rst_i) begin
      // LK-001, LK-002: exactly once per cycle, the right index, rising
      Rising_A:   assert (!(taken && dexg) || call[9:5] > prev_q);
      Twice_A:    assert (!(taken && dexg && call[9:5] == n_q) || calls_q == '0);
      Turn_A:     assert (!(taken && dexg && call[9:5] == n_q && steady_q) ||
                          (exp_v_q && sel == exp_b_q));
      Sel_A:      assert (!(taken && dexg && call[9:5] == n_q && steady_q && ext_q[exp_b_q] && !rid_q) ||
                          call[3] == !exp_b_q);
      // LK-021: DEXG or RDID
      Code_A:     assert (!(taken && dexg) || (call[10] == rid_q && call[4] == rid_q &&
                          (!rid_q || call[3:0] == {sel, 3'd1})));
      // LK-018: the nibble, as it was in the clock before the offer
      Nibble_A:   assert (!(dut.load_dexg && hit && quiet_q[0] && !read_id_i) ||
                          (dut.call_d[2:0] == due_q[dut.nxt_q[5]][2:0] &&
                           (ext_q[dut.nxt_q[5]] || dut.call_d[3] == due_q[dut.nxt_q[5]][3])));
      // LK-019: once, after the last DEXG and its books, before the extra slots, in every cycle that called a slot
      Exch_A:     assert (!exchange_done || (cyc_q && !xd_q && prev_q != '0 && !xm_q && !xi_q && !line_q &&
                          !req_valid && last_q != ErrAborted && mem_req && mem_we && mem_addr == Sent + 8'd2));
      ExchAll_A:  assert (!cycle_done || xd_q == (prev_q != '0));
      ExchDexg_A: assert (!(taken && dexg) || !xd_q);
      ExchOther_A: assert (!(taken && (mgmt || incl)) || xd_q == (prev_q != '0));
      Once_A:     assert (!(cycle_done && steady_q) || calls_q == 2'(exp_v_q));
      Retry_A:    assert (!(taken && dexg) || (retries == 2'(Retry) && !no_reply));
      // LK-015: what is switched off or lost is not called, whatever firmware writes
      Seen_A:     assert (!(dut.load_dexg && hit) || seen_q[dut.nxt_q[5]]);
      // LK-004: books of the number
      Streak_A:   assert (!(mem_state && mem_addr[4:0] == n_q) || (dut.cur_q == {mem_addr[5], n_q} &&
                          mem_wdata[SlotStateStreakLsb +: SlotStateStreakW] ==
                          (last_q == ErrOk ? '0 : streak_q[mem_addr[5]] + 3'(last_q != ErrAborted))));
      Lost_A:     assert (!(st == StInWr && dut.cur_q[4:0] == n_q) ||
                          lost == (!(last_q inside {ErrOk, ErrAborted}) && streak_q[dut.cur_q[5]] == 3'(Fail)));
      LostAt_A:   assert (!lost || st == StInWr);
      // LK-020: the calls of the number that were not aborted
      Sent_A:     assert (!(mem_state && mem_addr[4:0] == n_q) || mem_wdata[SlotStateSentLsb +: SlotStateSentW] ==
                          (last_q == ErrAborted ? inf_q[mem_addr[5]] : line_info_q));
      Calls_A:    assert (!(mem_state && mem_addr[4:0] == n_q) || mem_wdata[SlotStateCallsLsb +: SlotStateCallsW] ==
                          num_q[mem_addr[5]] + 4'(last_q != ErrAborted));
      // LK-016: management
      Once1_A:    assert (!(taken && mgmt) || (mpend && !mtaken_q && {sel, retries, no_reply, call} == mreq_q[14:0]));
      Answer_A:   assert (!mem_mres || (mpend && mem_wdata[23:16] == mreq_q[23:16] && mem_wdata[7:4] == last_q &&
                          (mtaken_q || (gone_q && last_q == ErrAborted))));
      Waits_A:    assert (mage_q <= 2'd1);
      Prompt_A:   assert (!(cycle_done && mbegin_q) || !(two_extra_i || mfree_q));
      // LK-008, LK-009: inclusion, and what a cycle may call
      Row_A:      assert (!(taken && mgmt && row_q) || two_extra_i);
      InclWaits_A: assert (iage_q <= 2'd2);
      Both_A:     assert (!(cycle_done && ibegin_q && two_extra_i) || xi_q);
      OneSlot_A:  assert (!(cycle_done && ibegin_q) || xi_q || xm_q);
      Mgmt_A:     assert (!(taken && mgmt) || (!xm_q && !xi_q));
      Incl_A:     assert (!(taken && incl) || (!xi_q && (!xm_q || two_extra_i) && ipick_q[RequestValidLsb] &&
                          {sel, retries, no_reply, call} == ipick_q[14:0]));
      InclRes_A:  assert (!mem_ires || mem_wdata[23:16] == ipick_q[23:16]);
      Last_A:     assert (!(taken && dexg) || (!xm_q && !xi_q));
      Phase_A:    assert (!(taken && cycle_busy) || phase == (mgmt ? PhaseManagement : incl ? PhaseInclusion :
                                                              PhaseDataExchange));
      // LK-017: one call at a time, held until taken; idle in a bounded time
      One_A:      assert (!(req_valid && line_q) && !(req_valid && !enable_i));
      Stable_A:   assert (!offered_q || !enable_i || (req_valid && held == held_q));
      Quit_A:     assert (!(batch_busy || cycle_busy) || int'(quit_q) < (batch_busy ? QuitBatch : QuitMax));
      // LK-013: the search is over before a result comes
      Search_A:   assert (!(res_valid_i && enable_i) || (st == StWait && !dut.sent_q && !dut.again_q));
      // LK-010: a batch returns every result, in its place
      BatchWr_A:  assert (!(mem_req && mem_we && mem_addr[7:6] == Batch[7:6]) || (batch_busy &&
                          mem_addr[5:0] == done_q[5:0] && done_q < len_q));
      BatchEnd_A: assert (!batch_done || st == StBatchLen || done_q == len_q);
      // LK-014
      Pace_A:     assert (!begun || idle_q || !same_q || min_q != min_cycle_us_i || us_q >= 14'(min_cycle_us_i));
      // the sequencer writes only what is its own
      Own_A:      assert (!(mem_req && mem_we) || (mem_addr[7:6] == State[7:6] && mem_addr[4:0] != '0) ||
                          mem_addr[7:6] == Batch[7:6] || mem_addr inside {MgmtRes, InclRes, [Sent:Sent + 8'd3],
                          [OutSnap:OutSnap + 8'd7], [InWork:InWork + 8'd7], [InImg:InImg + 8'd7]});
    end
  end
  // what the simulation of this harness has to reach (cocotb_tests/block/test_seq_rules.py)
  always_ff @(posedge clk_i) if (live_q && !rst_i) begin
    Once_C:    cover (cycle_done && steady_q && exp_v_q);
    Skipped_C: cover (cycle_done && steady_q && !exp_v_q && act_q != '0);
    TurnB_C:   cover (taken && dexg && steady_q && n_q == pos_q && sel && callable == 2'b11);
    Sel_C:     cover (taken && dexg && steady_q && n_q == pos_q && ext_q[exp_b_q] && call[3]);
    Change_C:  cover (cycle_done && !steady_q && calls_q != '0);
    OneLost_C: cover (lost && steady_q && dut.cur_q[4:0] == n_q);
    Longest_C: cover (mem_mres && mage_q == 2'd1);
    Refused_C: cover (st == StPick && dut.do_incl && dut.pend_q);
    InclMax_C: cover (st == StPick && dut.do_incl && iage_q == 2'd2);
    Prompt_C:  cover (cycle_done && mfree_q && xm_q);
    Both_C:    cover (cycle_done && ibegin_q && two_extra_i && xm_q);
    Gone_C:    cover (mem_mres && gone_q);
    Aborted_C: cover (mem_mres && mtaken_q && last_q == ErrAborted);
    Offer_C:   cover (dut.timed_q && dut.valid_q && dut.since_q >= 33);
    Quit_C:    cover (quit_q >= 10'd100 && cycle_busy && dut.state_d == StIdle);
    QuitB_C:   cover (quit_q >= 10'd440 && batch_busy && dut.state_d == StIdle);
    Paced_C:   cover (begun && !idle_q && same_q && min_cycle_us_i >= 13'd200 &&
                      us_q <= 14'(min_cycle_us_i) + 14'd2);
    Again_C:   cover (repeat_i && dexg && call[9:5] == n_q);
    Live_C:    cover (dut.load_dexg && hit && quiet_q[0] && !read_id_i && dut.live && !dut.snap_q &&
                      img_q[dut.nxt_q[5]] != snap_q[dut.nxt_q[5]] && prev_q != '0);
    LiveOne_C: cover (dut.load_dexg && hit && quiet_q[0] && !read_id_i && dut.live && !dut.snap_q && prev_q == '0);
    Snap_C:    cover (dut.load_dexg && hit && quiet_q[0] && !read_id_i && !dut.live && !dut.snap_q &&
                      img_q[dut.nxt_q[5]] != snap_q[dut.nxt_q[5]]);
    ReadId_C:  cover (taken && dexg && rid_q && sel && call[9:5] == n_q);
    Exch_C:    cover (cycle_done && xd_q && (xm_q || xi_q));
    ExchNone_C: cover (cycle_done && !xd_q);
    ExchBad_C: cover (exchange_done && last_q != ErrOk);
    Wraps_C:   cover (mem_state && mem_addr[4:0] == n_q && num_q[mem_addr[5]] == '1 &&
                      mem_wdata[SlotStateCallsLsb +: SlotStateCallsW] == '0);
  end
  // ------------------------------------------------------------------------------------------ for the induction
  always_ff @(posedge clk_i) if (live_q) begin
    Known_I:    assert (st <= StPace);
    Open_I:     assert (dut.open_q == (dut.valid_q || line_q || dut.res_q) &&
                        2'(dut.valid_q) + 2'(line_q) + 2'(dut.res_q) <= 2'd1);
    Where_I:    assert (!dut.open_q || st inside {StScan, StCopy, StWait, StTally});
    Waits_I:    assert (!(st inside {StWait, StTally}) || dut.open_q);
    Tally_I:    assert (!(dut.sent_q || dut.again_q) || (dut.open_q && !dut.valid_q));
    Tallied_I:  assert (st != StTally || dut.sent_q || dut.again_q);
    Gone_I:     assert (!(gone_q && dut.open_q) || (dut.res_q && !dut.sent_q && !dut.again_q));
    Result_I:   assert (!(dut.res_q || books) || (dut.last_q == last_q && (!gone_q || last_q == ErrAborted)));
    GoneAt_I:   assert (!gone_q || dut.res_q || books);
    // kinds and states
    Batch_I:    assert (!batch || st inside {StIdle, StBatchLen, StBatchRd, StBatchLd, StWait, StTally, StResWr,
                        StFailRd, StFailWr});
    Batches_I:  assert (!(st inside {StBatchLen, StBatchRd, StBatchLd}) || batch);
    Dexg_I:     assert (!(st inside {StStateRd, StInRd, StInWr, StFetch, StLoad, StMgmtReq, StMgmtRes}) || dexg);
    Pick_I:     assert (!(st inside {StIncl, StPick}) || dexg || mgmt);
    Cnt_I:      assert (st inside {StIdle, StScan, StCopy} || batch || dut.cnt_q == '0);
    ScanCnt_I:  assert (st != StScan || (dut.cnt_q <= 4'd4 && (scan_n != '0 || dut.cnt_q == '0)));
    Par_I:      assert (par_q == dut.odd_q);
    Cyc_I:      assert (cyc_q == (!batch && !(st inside {StIdle, StPace}) && !(st == StScan && !dut.open_q)));
    Snap_I:     assert (!dut.snap_q || (st inside {StFetch, StLoad, StMgmtReq, StMgmtRes, StIncl, StPick, StCopy} &&
                        (dut.open_q || (dut.first_q && pos_q == '0))));
    CopyOpen_I: assert (!(st == StCopy && dut.open_q) || dut.snap_q);
    First_I:    assert (!dut.first_q || !line_q);
    FirstAt_I:  assert (!(dut.first_q && (dut.res_q || books)) || gone_q);
    Begin_I:    assert (!(st inside {StFetch, StLoad}) || (pos_q == '0 ? dut.first_q : !dut.first_q && dut.nxt_v_q));
    // the times
    Left_I:     assert (int'(quit_q) + left <= (batch && st != StIdle ? QuitBatch : QuitMax) || st == StIdle);
    SearchT_I:  assert (!(dut.open_q && st inside {StScan, StCopy}) || int'(age_q) + scan_left +
                        (st == StCopy ? 16 - int'(dut.cnt_q) : 0) <= SearchMax);
    SentAge_I:  assert (!(line_q && st inside {StScan, StCopy}) || sent_age_q <= age_q);
    SentAt_I:   assert (!(line_q && (dut.sent_q || dut.again_q) && st inside {StWait, StTally}) ||
                        int'(sent_age_q) <= SearchMax + 1 + (dut.sent_q ? 0 : 2) + int'(st == StTally));
    Offer_I:    assert (!dut.timed_q || int'(dut.since_q) <= offer_at);
    OfferAt_I:  assert (!dut.timed_q || dut.valid_q || (!(st inside {StScan, StTally}) &&
                        (!dut.first_q || st inside {StFetch, StLoad, StMgmtReq, StMgmtRes, StIncl, StPick}) &&
                        (st != StWait || (dut.res_q && !dut.sent_q && !dut.again_q)) &&
                        (st != StCopy || !dut.snap_q)));
    // the search: what was read, what was passed, what was found
    Read_I:     assert (!(st == StScan && hit) || (
      (dut.cnt_q != 4'd1 || (rdata_q[SlotActiveLsb] == act_q[0] && rdata_q[SlotExtendedLsb] == ext_q[0] &&
                             rdata_q[SlotLiveLsb] == livesl_q[0])) &&
      (dut.cnt_q != 4'd2 || (dut.a_q == act_q[0] && rdata_q[SlotStateStreakLsb +: 3] == streak_q[0])) &&
      (dut.cnt_q <  4'd2 || dut.opt_q == {livesl_q[0], ext_q[0]}) &&
      (dut.cnt_q <  4'd3 || (dut.a_q == callable[0] && (!dut.a_q || seen_q[0]))) &&
      (dut.cnt_q != 4'd3 || (rdata_q[SlotActiveLsb] == act_q[1] && rdata_q[SlotExtendedLsb] == ext_q[1] &&
                             rdata_q[SlotLiveLsb] == livesl_q[1])) &&
      (dut.cnt_q != 4'd4 || (dut.b_q == act_q[1] && dut.opt_b_q == {livesl_q[1], ext_q[1]} &&
                             rdata_q[SlotStateStreakLsb +: 3] == streak_q[1]))));
    Quiet_I:    assert ((!quiet_q[2] || quiet_q[1]) && (!quiet_q[1] || quiet_q[0]));
    Number_I:   assert (!(over && dut.nxt_v_q) || scan_n != '0);
    Start_I:    assert (!(st == StCopy && dut.open_q) || (!dut.wrap_q && scan_n == from_q + 5'd1));
    Ahead_I:    assert (st != StScan || dut.wrap_q || scan_n > from_q || scan_n == '0);
    Ahead2_I:   assert (!(over && dut.nxt_v_q) || dut.wrap_q || scan_n > from_q);
    From_I:     assert (!(dut.open_q && !batch) || from_q == (dexg ? pos_q : 5'd31));
    FromB_I:    assert (!(books && dexg) || from_q == pos_q);
    FromC_I:    assert (!(st inside {StFetch, StLoad} && dut.nxt_v_q) || (dut.wrap_q ? pos_q == '0 : from_q == pos_q));
    FromD_I:    assert (!(st == StPace && dut.nxt_v_q) || dut.wrap_q || from_q == '0);
    FromE_I:    assert (!(st == StScan && !dut.open_q) || (from_q == '0 && quiet_q[0] == quiet_q[2]));
    Wrap_I:     assert (!(extra && over && dut.nxt_v_q) || dut.wrap_q);
    Passed_I:   assert (!(quiet_q[2] && (st == StScan || (over && dut.nxt_v_q)) && passed) || !now_v);
    None_I:     assert (!(quiet_q[2] && over && !dut.nxt_v_q) || !now_v);
    Found_I:    assert (!(over && dut.nxt_v_q && hit) || (seen_q[dut.nxt_q[5]] && (!quiet_q[0] ||
                        (dut.opt_q == {livesl_q[dut.nxt_q[5]], ext_q[dut.nxt_q[5]]} &&
                        (callable[dut.nxt_q[5]] || losing)))));
    Turn_I:     assert (!(over && dut.nxt_v_q && hit && quiet_q[1]) || losing ||
                        dut.nxt_q[5] == (callable[1] && (!callable[0] || target)));
    Losing_I:   assert (!(losing && hit && quiet_q[2]) || !now_v);
    LostQ_I:    assert (!(st inside {StInRd, StInWr} && dut.cur_q[4:0] == n_q) || dut.lost_q ==
                        (!(last_q inside {ErrOk, ErrAborted}) && streak_q[dut.cur_q[5]] == 3'(Fail)));
    ReadSt_I:   assert (!(st == StResWr && dexg && dut.cur_q[4:0] == n_q) ||
                        (rdata_q[SlotStateStreakLsb +: 3] == streak_q[dut.cur_q[5]] &&
                        rdata_q[SlotStateSentLsb +: 4] == inf_q[dut.cur_q[5]] &&
                        rdata_q[SlotStateCallsLsb +: 4] == num_q[dut.cur_q[5]]));
    Cur_I:      assert (!(dexg && (dut.open_q || st inside {StStateRd, StResWr}) && pos_q == n_q) ||
                        ((!quiet_q[1] || callable[dut.cur_q[5]]) && (!quiet_q[2] || dut.cur_q[5] == now_b)));
    Pos_I:      assert (!(dexg && (dut.open_q || books)) || (dut.cur_q[4:0] == pos_q && pos_q != '0));
    Call_I:     assert (!(dexg && dut.open_q) || (dut.call_q[9:5] == pos_q && dut.sel_q == dut.cur_q[5] &&
                        dut.call_q[10] == rid_q && dut.call_q[4] == rid_q &&
                        (!rid_q || dut.call_q[3:0] == {dut.sel_q, 3'd1}) &&
                        dut.retries_q == 2'(Retry) && !dut.no_reply_q));
    Info_I:     assert (!(dexg && (dut.open_q || st inside {StStateRd, StResWr})) || gone_q ||
                        dut.tag_q[7:4] == (dut.valid_q ? dut.call_q[3:0] : line_info_q));
    Sel_I:      assert (!(dexg && dut.valid_q && steady_q && pos_q == n_q && ext_q[dut.cur_q[5]] && !rid_q) ||
                        dut.call_q[3] == !dut.cur_q[5]);
    // exchange_done
    PrevAt_I:   assert (!(cyc_q && dexg && (dut.open_q || books) && !dut.valid_q && !gone_q) || prev_q == pos_q);
    PrevEx_I:   assert (!(cyc_q && extra) || prev_q == pos_q);
    Exch_I:     assert (!cyc_q || xd_q == (extra && pos_q != '0));
    // the calls of the cycle
    Steady_I:   assert (!(cyc_q && steady_q) || quiet_q[2]);
    Prev_I:     assert (!cyc_q || prev_q < pos_q || (prev_q == pos_q && !(dexg && dut.valid_q)));
    Calls_I:    assert (!cyc_q || (calls_q <= 2'd1 && (n_q <= pos_q || calls_q == '0) &&
                        (!(n_q == pos_q && dexg && dut.valid_q) || calls_q == '0)));
    Before_I:   assert (!(cyc_q && steady_q && n_q > pos_q) || (exp_v_q == now_v && exp_b_q == now_b));
    At_I:       assert (!(cyc_q && steady_q && n_q == pos_q && dexg && (dut.open_q || books)) ||
                        (exp_v_q && dut.cur_q[5] == exp_b_q));
    After_I:    assert (!(cyc_q && steady_q && n_q <= pos_q) || (n_q == pos_q && dexg && (dut.valid_q || gone_q)) ||
                        calls_q == 2'(exp_v_q));
    Extra_I:    assert (!(cyc_q && steady_q && extra) || calls_q == 2'(exp_v_q));
    // extra slots
    ReadM_I:    assert (st != StMgmtRes || rdata_q == mreq_q);
    ReadR_I:    assert (!(st == StIncl && dexg) || (dut.tag_q == mreq_q[23:16] && rdata_q[23:16] == mres_q &&
                        {dut.sel_q, dut.retries_q, dut.no_reply_q, dut.call_q} == mreq_q[14:0]));
    ReadI_I:    assert (st != StPick || (rdata_q == ireq_q && (dexg ? dut.pend_q == mpend &&
                        dut.tag_q == mreq_q[23:16] &&
                        {dut.sel_q, dut.retries_q, dut.no_reply_q, dut.call_q} == mreq_q[14:0] :
                        !dut.pend_q)));
    Mgmt_I:     assert (!mgmt_open || (mpend && dut.tag_q == mreq_q[23:16] && (dut.valid_q ? !mtaken_q &&
                        {dut.sel_q, dut.retries_q, dut.no_reply_q, dut.call_q} == mreq_q[14:0] : mtaken_q || gone_q)));
    Mtaken_I:   assert (!mtaken_q || mgmt_open);
    Incl_I:     assert (!(incl && (dut.open_q || st == StResWr)) || (dut.tag_q == ipick_q[23:16] && (!dut.valid_q ||
                        ({dut.sel_q, dut.retries_q, dut.no_reply_q, dut.call_q} == ipick_q[14:0] && ipick_q[31]))));
    Answered_I: assert (!(mgmt && st inside {StFailRd, StFailWr, StIncl, StPick}) ||
                        (!mpend && (st == StFailRd || mage_q == '0)));
    Picked_I:   assert (picked_q == (extra && (mgmt || incl || st inside {StCopy, StCycRd, StCycWr})));
    MageA_I:    assert (!(mage_q != '0 && mpend && !picked_q) || !dut.was_mgmt_q);
    MageB_I:    assert (!(mpend && picked_q && !mgmt_open) || (!dut.was_mgmt_q && mage_q == '0));
    MageC_I:    assert (!(mage_q != '0 && !mpend) || (mgmt && st == StFailRd));
    IageA_I:    assert (!(iage_q == 2'd2) || dut.was_mgmt_q);
    IageB_I:    assert (!(iage_q != '0 && picked_q) || (dut.was_mgmt_q && (two_extra_i ? mgmt_on : iage_q == 2'd1)) ||
                        !ivalid);
    Was_I:      assert ((!mgmt_on || dut.was_mgmt_q) && (!picked_q || mgmt || !dut.was_mgmt_q));
    Row_I:      assert (!row_q || (dut.was_mgmt_q && !(mgmt && dut.valid_q) && (ivalid || !mem_req_q)));
    Mbegin_I:   assert (!(cyc_q && picked_q && mbegin_q && !mgmt_open && !(mgmt && st == StFailRd)) ||
                        (!two_extra_i && !mfree_q && mpend));
    Mfree_I:    assert (!(cyc_q && mfree_q) || !ivalid);
    Ibegin_I:   assert (!(cyc_q && ibegin_q) || ivalid);
    Both_I:     assert (!(cyc_q && picked_q && ibegin_q && two_extra_i) || mgmt_on ||
                        (incl && (dut.valid_q || gone_q)) || xi_q);
    One_I:      assert (!(cyc_q && picked_q && ibegin_q) || dut.valid_q || gone_q || xi_q || xm_q);
    Xnone_I:    assert (!(cyc_q && !picked_q) || (!xm_q && !xi_q));
    Xmgmt_I:    assert (!(cyc_q && mgmt) || (!xi_q && !(dut.valid_q && xm_q)));
    Xincl_I:    assert (!(cyc_q && incl) || ((!xm_q || two_extra_i) && !(dut.valid_q && xi_q)));
    Xtwo_I:     assert (!(mgmt && st inside {StIncl, StPick}) || two_extra_i);
    // batch, pace
    Len_I:      assert (!(batch && !(st inside {StIdle, StBatchLen})) || (len_q >= 7'd1 && len_q <= 7'd64 &&
                        dut.nxt_q == len_q[5:0] && dut.cur_q == done_q[5:0] && done_q <= len_q &&
                        (st inside {StFailRd, StFailWr} ? done_q != '0 : done_q < len_q)));
    LenCur_I:   assert (st != StBatchLen || dut.cur_q == '0);
    Us_I:       assert (idle_q || us_q[13] || dut.us_q == us_q[12:0]);
    Paced_I:    assert (idle_q || !dut.paced_q || !same_q || us_q >= 14'(min_q));
  end
endmodule
