// SPDX-License-Identifier: Apache-2.0
// asi_trace: readable text for waveforms: what is asked, what is answered, in which phase. Simulation only (PL-003).
// Show the *_text_o signals as ASCII, the nibble signals as hexadecimal: digit n from the right belongs to index n.
// Texts are left-justified with spaces. It learns from RDID answers which numbers use A/B addressing.
`ifndef SYNTHESIS
module asi_trace
  import asi_map_pkg::*;
#(
  localparam int unsigned Chars = 14  // of every text
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
  output logic [8*Chars-1:0]  phase_text_o,
  output logic [63:0][3:0]    outputs_o,      // last DEXG data per slave, line level
  output logic [63:0][3:0]    inputs_o        // last valid DEXG answer per slave
);
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
  logic [63:0][3:0] outputs_d, inputs_d;

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
      out.name = info == 5'd0 ? "DELA" : "WID1";
      if (info != 5'd0) out.data = bits_text(info, 3'd4);
    end else if (number == 5'd31 && info == 5'b10101) begin
      out.name = "BR01"; out.no_answer = 1'b1;
    end else if (number == 5'd0 && info == 5'b11101) begin
      out.name = "PRGM"; out.no_answer = 1'b1;
    end else if (info == 5'b11111) begin
      out.name = "R1  ";
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
    outputs_d = outputs_o;
    inputs_d  = inputs_o;
    if (res_i) begin
      answer_d = class_text(res_class_i);
      if (res_class_i == ErrOk) begin
        answer_d = call_q.no_answer ? "none          " : {bits_text({1'b0, res_data_i}, 3'd4), "         "};
        if (call_q.is_rdid) ext_d[call_q.index[4:0]] = res_data_i == 4'hA;
        if (call_q.is_dexg) inputs_d[call_q.index] = res_data_i;
      end
    end
    if (req_i) begin
      call_d    = decode(req_call_i, ext_d);
      request_d = {call_d.name, " ", call_d.address, " ", call_d.data};
      if (call_d.is_dexg) outputs_d[call_d.index] = req_call_i[3:0];
    end
  end

  always_ff @(posedge clk_i) begin
    if (rst_i) begin
      ext_q          <= '0;
      call_q         <= '0;
      request_text_o <= "              ";
      answer_text_o  <= "              ";
      outputs_o      <= '1;
      inputs_o       <= '0;
    end else begin
      ext_q          <= ext_d;
      call_q         <= call_d;
      request_text_o <= request_d;
      answer_text_o  <= answer_d;
      outputs_o      <= outputs_d;
      inputs_o       <= inputs_d;
    end
  end
endmodule
`endif
