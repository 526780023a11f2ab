// SPDX-License-Identifier: Apache-2.0
// asi_trace: readable text for waveforms: what is asked, what is answered, in which phase. Simulation only (PL-003).
// Show every text as ASCII; texts are left-justified with spaces. last_a, last_b: the last data of each slave, element
// = number, blank until its first DEXG. It learns from RDID answers which numbers use A/B addressing.
`ifndef SYNTHESIS
module asi_trace
  import asi_map_pkg::*;
#(
  localparam int unsigned Chars = 14  // of the three texts
) (
  input  logic                clk_i, rst_i,
  input  logic                req_i,          // one clock: asi_xact takes a call
  input  logic [10:0]         req_call_i,     // CB A4..A0 I4..I0
  input  logic                res_i,          // one clock: its result
  input  error_class_e        res_class_i,
  input  logic [3:0]          res_data_i,
  input  phase_e              phase_i,
  output logic [8*Chars-1:0]  request_text_o, // "DEXG 17B 101", the last call taken
  output logic [8*Chars-1:0]  answer_text_o,  // "0110" or the error class; stays until the next result, to be readable
  output logic [8*Chars-1:0]  phase_text_o
);
  typedef logic [8*12-1:0] slave_text_t;  // "1010 -> 0111"; "1010 !> 0111": the last answer was none or bad
  // two arrays of 32, because a simulator may leave larger ones out of the waves. Written one element at a time and
  // not through a next-state signal: copying and comparing them all would slow a traced run down.
  slave_text_t last_a [32];   // standard and A slaves
  slave_text_t last_b [32];   // B slaves
  typedef logic [8*Chars-1:0] text_t;
  typedef struct packed {
    logic [31:0] name;       // four letters
    logic [23:0] address;    // three letters
    logic [39:0] data;       // five letters
    logic        is_dexg;
    logic        is_rdid;
    logic        no_answer;  // a broadcast
    logic [5:0]  index;
  } decoded_t;

  logic [31:0] ext_d, ext_q;  // this number uses A/B addressing
  decoded_t    call_d, call_q;
  text_t       request_d, answer_d;
  logic [31:0] old_input;     // four letters: the last valid answer of the slave that is called
  slave_text_t slave_text;

  function automatic logic [7:0] digit(logic [3:0] value);
    return 8'h30 + 8'(value);
  endfunction

  // "5  ", "5A ", "17B"
  function automatic logic [23:0] address_text(logic [4:0] number, logic sel, logic extended);
    logic [7:0] letter;
    letter = sel ? "B" : (extended && number != 5'd0) ? "A" : " ";
    if (number < 5'd10) return {digit(4'(number)), letter, " "};
    return {digit(4'(number / 5'd10)), digit(4'(number % 5'd10)), letter};
  endfunction

  function automatic logic [39:0] bits_text(logic [4:0] value, logic [2:0] count);
    logic [39:0] text;
    text = "     ";
    for (int k = 0; k < 5; k++)
      if (k < int'(count)) text[8*(4-k) +: 8] = {7'h18, value[3'(int'(count) - 1 - k)]};
    return text;
  endfunction

  function automatic decoded_t decode(logic [10:0] call, logic [31:0] ext);
    decoded_t   out;
    logic       cb, known, sel, has_data;
    logic [4:0] number, info;
    {cb, number, info} = call;
    known    = ext[number] && number != 5'd0;
    sel      = 1'b0;
    has_data = 1'b0;
    out      = '{name: "?   ", address: "   ", data: "     ", is_dexg: 1'b0, is_rdid: 1'b0, no_answer: 1'b0, index: '0};
    if (!cb && number == 5'd0) begin
      out.name = "ADRA"; out.data = bits_text(info, 3'd5);
    end else if (!cb) begin
      out.name    = info[4] ? "WPAR" : "DEXG";
      out.is_dexg = !info[4];
      sel         = known && !info[3];
      has_data    = 1'b1;
    end else if (number == 5'd0 && !info[4]) begin
      out.name = "WID1"; out.data = bits_text(info, 3'd4);
    end else if (number == 5'd31 && info == 5'b10101) begin
      out.name = "BR01"; out.no_answer = 1'b1;
    end else if (number == 5'd0 && info == 5'b11101) begin
      out.name = "PRGM"; out.no_answer = 1'b1;
    end else begin
      sel = info[3];
      unique case ({info[4], info[2:0]})
        4'b0000: out.name = "DELA";
        4'b1000: out.name = "RDIO";
        4'b1001: begin out.name = "RDID"; out.is_rdid = 1'b1; end
        4'b1010: out.name = "RID1";
        4'b1011: out.name = "RID2";
        4'b1100: begin out.name = "RES "; sel = !info[3]; end
        4'b1110: begin out.name = "RDST"; sel = !info[3]; end
        4'b1111: begin out.name = "R1  "; sel = !info[3]; end
        default: sel = 1'b0;
      endcase
    end
    if (has_data) out.data = bits_text(info, known ? 3'd3 : 3'd4);
    out.index   = {sel, number};
    out.address = out.no_answer ? "all" : address_text(number, sel, known);
    return out;
  endfunction

  function automatic text_t class_text(error_class_e value);
    unique case (value)
      ErrNoResponse:    return "NO_RESPONSE   ";
      ErrStart:         return "START         ";
      ErrAlternation:   return "ALTERNATION   ";
      ErrTiming:        return "TIMING        ";
      ErrNoInformation: return "NO_INFORMATION";
      ErrEndBit:        return "END_BIT       ";
      ErrParity:        return "PARITY        ";
      ErrLength:        return "LENGTH        ";
      ErrEarly:         return "EARLY         ";
      ErrBadMaster:     return "BAD_MASTER    ";
      ErrAborted:       return "ABORTED       ";
      default:          return "?             ";
    endcase
  endfunction

  always_comb begin
    unique case (phase_i)
      PhaseOffline:      phase_text_o = "OFFLINE       ";
      PhaseDetection:    phase_text_o = "DETECTION     ";
      PhaseActivation:   phase_text_o = "ACTIVATION    ";
      PhaseDataExchange: phase_text_o = "DATA_EXCHANGE ";
      PhaseManagement:   phase_text_o = "MANAGEMENT    ";
      PhaseInclusion:    phase_text_o = "INCLUSION     ";
      default:           phase_text_o = "?             ";
    endcase
  end

  always_comb begin
    ext_d     = ext_q;
    call_d    = call_q;
    request_d = request_text_o;
    answer_d  = answer_text_o;
    if (res_i) begin
      answer_d = class_text(res_class_i);
      if (res_class_i == ErrOk) begin
        answer_d = call_q.no_answer ? "none          " : {bits_text({1'b0, res_data_i}, 3'd4), "         "};
        if (call_q.is_rdid) ext_d[call_q.index[4:0]] = res_data_i == 4'hA;
      end
    end
    if (req_i) begin
      call_d    = decode(req_call_i, ext_d);
      request_d = {call_d.name, " ", call_d.address, " ", call_d.data};
    end
  end

  assign old_input  = call_q.index[5] ? last_b[call_q.index[4:0]][31:0] : last_a[call_q.index[4:0]][31:0];
  assign slave_text = res_class_i == ErrOk ? {call_q.data[39:8], " -> ", bits_text({1'b0, res_data_i}, 3'd4)[39:8]}
                                           : {call_q.data[39:8], " !> ", old_input};

  always_ff @(posedge clk_i) begin
    if (rst_i) begin
      ext_q          <= '0;
      call_q         <= '0;
      request_text_o <= "              ";
      answer_text_o  <= "              ";
    end else begin
      ext_q          <= ext_d;
      call_q         <= call_d;
      request_text_o <= request_d;
      answer_text_o  <= answer_d;
    end
  end

  always_ff @(posedge clk_i) begin
    if (rst_i) begin
      for (int k = 0; k < 32; k++) begin
        last_a[k] <= "            ";
        last_b[k] <= "            ";
      end
    end else if (res_i && call_q.is_dexg) begin
      if (call_q.index[5]) last_b[call_q.index[4:0]] <= slave_text;
      else last_a[call_q.index[4:0]] <= slave_text;
    end
  end
endmodule
`endif
