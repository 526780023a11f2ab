// SPDX-License-Identifier: Apache-2.0
// asi_line_guard: power fail and earth fault of the line. A state of the power input below ApfDipNs is ignored in
// both directions, because telegrams ride on the supply; then the set and clear times differ.
// apf_o after reset: 1 until the line was good for ApfOkNs. efault_o follows its input when that was the same for EfNs
// without a break, 0 after reset. Times hold within one tick.
// Requirements: LT-010, LT-016 (docs/requirements.md).
module asi_line_guard #(
  parameter int unsigned ApfOnNs  = asi_timing_pkg::ApfOnNs,
  parameter int unsigned ApfOkNs  = asi_timing_pkg::ApfOkNs,
  parameter int unsigned ApfDipNs = asi_timing_pkg::ApfDipNs,
  parameter int unsigned EfNs     = asi_timing_pkg::EfNs
) (
  input  logic clk_i, rst_i,      // rst_i: synchronous, active high
  input  logic tick_i,            // one clock per microsecond
  input  logic apf_ni, efault_i,  // pins: low = line voltage too low; high = earth fault
  output logic apf_o, efault_o    // filtered: power fail, earth fault
);
  // One tick more than the time in us: the first tick comes somewhere in the first microsecond.
  localparam int unsigned DipTicks = ApfDipNs / 1000 + 1;
  localparam int unsigned OnTicks  = ApfOnNs  / 1000 + 1 - DipTicks;
  localparam int unsigned OkTicks  = ApfOkNs  / 1000 + 1 - DipTicks;
  localparam int unsigned DipW     = $clog2(DipTicks);
  localparam int unsigned EfTicks  = EfNs     / 1000 + 1;
  localparam int unsigned EfW      = $clog2(EfTicks);
  // The earth fault count starts so that its overflow is the end of the time: no comparator over its 20 bits.
  localparam logic [EfW-1:0] EfStart = EfW'((1 << EfW) - EfTicks);
  localparam int unsigned CntW     = $clog2((OkTicks > OnTicks ? OkTicks : OnTicks) + 1);
  logic            good, good_d, good_q;  // good_q: without dips
  logic [DipW-1:0] dip_d, dip_q;          // ticks in which the pin disagreed with good_q
  logic [CntW-1:0] cnt_d, cnt_q;          // ticks in which good_q disagreed with apf_o
  logic            apf_d;
  logic            earth, ef_over;        // the pin; it disagreed with efault_o for long enough
  logic [EfW-1:0]  ef_d, ef_q;            // ticks in which it did, from EfStart on

  asi_sync #(.Width(2)) i_sync (.clk_i, .rst_i, .async_i({apf_ni, efault_i}), .sync_o({good, earth}));

  always_comb begin
    good_d = good_q;  dip_d = dip_q;  cnt_d = cnt_q;  apf_d = apf_o;
    if (good == good_q) dip_d = '0;
    else if (tick_i) begin
      dip_d = dip_q + 1'b1;
      if (dip_q == DipW'(DipTicks - 1)) begin good_d = good; dip_d = '0; end
    end
    if (good_q != apf_o) cnt_d = '0;      // they agree: power good, no fail, or the other way round
    else if (tick_i) begin
      if (cnt_q != (apf_o ? CntW'(OkTicks - 1) : CntW'(OnTicks - 1))) cnt_d = cnt_q + 1'b1;
      else if (good == good_q) begin      // else wait: the state may have ended, that is a dip so far
        apf_d = !apf_o;  cnt_d = '0;
      end
    end
    {ef_over, ef_d} = {1'b0, ef_q} + (EfW + 1)'(tick_i);
    if (earth == efault_o || ef_over) ef_d = EfStart;
  end

  always_ff @(posedge clk_i) begin
    good_q   <= rst_i ? 1'b0    : good_d;
    dip_q    <= rst_i ? '0      : dip_d;
    cnt_q    <= rst_i ? '0      : cnt_d;
    ef_q     <= rst_i ? EfStart : ef_d;
    apf_o    <= rst_i ? 1'b1    : apf_d;
    efault_o <= rst_i ? 1'b0    : ef_over ? earth : efault_o;
  end

`ifndef SYNTHESIS
  initial Times_A: assert (ApfOnNs > ApfDipNs && ApfOkNs > ApfDipNs && EfNs >= 1_000);
  always_ff @(posedge clk_i) if (!rst_i) begin
    Change_A: assert (apf_d == apf_o || (tick_i && apf_d != good_q));
    Fail_C:   cover (!apf_o && apf_d);
    Clear_C:  cover (apf_o && !apf_d);
    Earth_C:  cover (ef_over && earth && !efault_o);
    Gone_C:   cover (ef_over && !earth && efault_o);
  end
`endif
endmodule
