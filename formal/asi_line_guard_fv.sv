// SPDX-License-Identifier: Apache-2.0
// Proof of asi_line_guard (LT-010, LT-016), unbounded, for any ticks and any behaviour of the pins. Times are counted
// in ticks of one microsecond: n + 1 ticks span more than n us, n us span at least n ticks.
module asi_line_guard_fv (input logic clk_i, rst_i, tick_i, apf_ni, efault_i);
`ifdef FV_COVER
  localparam int unsigned OnUs = 5, OkUs = 8, DipUs = 2, EfUs = 12;
`else
  localparam int unsigned OnUs = 1_000, OkUs = 10_000, DipUs = 6, EfUs = 1_000_000;
`endif
  logic apf, efault;
  asi_line_guard #(.ApfOnNs(OnUs * 1_000), .ApfOkNs(OkUs * 1_000), .ApfDipNs(DipUs * 1_000),
                   .EfNs(EfUs * 1_000)) dut (
    .clk_i, .rst_i, .tick_i, .apf_ni, .efault_i, .apf_o(apf), .efault_o(efault)
  );

  logic        init_q = 1'b1, live_q = 1'b0;
  logic        good1_q, good_q, efault1_q, efault2_q;  // the pins, two clocks later
  logic [14:0] low_q, high_q;    // ticks without a break in which the voltage is low, good
  logic [14:0] fail_q, clear_q;  // ticks since the voltage was good (low) for longer than a dip
  logic [20:0] present_q, gone_q;  // ticks without a break in which there is an earth fault, none
  logic        apf_q, ef_q;
  logic [3:0]  run;
  function automatic logic [14:0] count(logic zero, logic step, logic [14:0] n);
    return zero ? '0 : (step && n != '1) ? n + 1'b1 : n;
  endfunction
  assign run = good_q ? 4'(high_q > 15 ? 15 : high_q) : 4'(low_q > 15 ? 15 : low_q);

  always_ff @(posedge clk_i) begin
    init_q <= 1'b0;
    if (init_q) assume (rst_i);
`ifdef FV_COVER
    assume (rst_i == init_q && tick_i);
`endif
    live_q <= 1'b1;
    {good_q, good1_q}      <= rst_i ? '0 : {good1_q, apf_ni};
    {efault2_q, efault1_q} <= rst_i ? '0 : {efault1_q, efault_i};
    low_q   <= count(rst_i || good_q, tick_i, low_q);
    high_q  <= count(rst_i || !good_q, tick_i, high_q);
    fail_q  <= count(rst_i || (good_q && high_q + 15'(tick_i) > 15'(DipUs)), tick_i, fail_q);
    clear_q <= count(rst_i || (!good_q && low_q + 15'(tick_i) > 15'(DipUs)), tick_i, clear_q);
    present_q <= (rst_i || !efault2_q) ? '0 : (tick_i && present_q != '1) ? present_q + 1'b1 : present_q;
    gone_q    <= (rst_i ||  efault2_q) ? '0 : (tick_i && gone_q    != '1) ? gone_q    + 1'b1 : gone_q;
    apf_q   <= rst_i || apf;
    ef_q    <= !rst_i && efault;
    if (live_q) begin
      // earth fault: never too early, never too late
      Earth_A: assert (!(efault && !ef_q) || present_q > 21'(EfUs));
      Gone_A:  assert (!(!efault && ef_q) || gone_q > 21'(EfUs));
      Set_A:   assert (efault || present_q <= 21'(EfUs));
      Clr_A:   assert (!efault || gone_q <= 21'(EfUs));
      // never too early, and a dip of up to DipUs changes nothing
      Early_A: assert (!(apf && !apf_q) || fail_q > 15'(OnUs));
      Clear_A: assert (!(!apf && apf_q) || clear_q > 15'(OkUs));
      // never too late
      Late_A:  assert (apf || low_q <= 15'(OnUs + 1));
      Stuck_A: assert (!apf || high_q <= 15'(OkUs + 1));
      // for the induction: the counters of the block against those of the rule
      Pin_A:   assert (dut.good == good_q && dut.earth == efault2_q);
      Ef_A:    assert (21'(dut.ef_q) - 21'(dut.EfStart) == (efault ? gone_q : present_q));
      Runs_A:  assert ((good_q || fail_q >= low_q) && (!good_q || clear_q >= high_q));
      Zero_A:  assert (low_q == '0 || high_q == '0);
      Dip_A:   assert (dut.good_q == good_q || dut.dip_q == 3'(run));
      Limit_A: assert (15'(dut.cnt_q) < 15'((apf ? OkUs : OnUs) - DipUs));
      Dips_A:  assert (dut.dip_q <= 3'(DipUs));
      Low_A:   assert (good_q || !dut.good_q || low_q <= 15'(DipUs));
      High_A:  assert (!good_q || dut.good_q || high_q <= 15'(DipUs));
      Fail_A:  assert (apf || dut.good_q || fail_q >= 15'(dut.cnt_q) + 15'(DipUs + 1) || fail_q == '1);
      Ok_A:    assert (!apf || !dut.good_q || clear_q >= 15'(dut.cnt_q) + 15'(DipUs + 1) || clear_q == '1);
      Lag_A:   assert (good_q || dut.good_q || apf || 15'(dut.cnt_q) + 15'(DipUs + 1) >= low_q);
      Lags_A:  assert (!good_q || !dut.good_q || !apf || 15'(dut.cnt_q) + 15'(DipUs + 1) >= high_q);
    end
    Dip_C:   cover (!rst_i && !apf && low_q == 15'(DipUs) && good1_q);
    Again_C: cover (!rst_i && apf && !apf_q);
  end
endmodule
