// SPDX-License-Identifier: Apache-2.0
// Time line, sorting and jumps of the report. The numbers are in the page already; texts go in as textContent only.
"use strict";
(() => {
  const byId = (id) => document.getElementById(id);
  const data = JSON.parse(byId("data").textContent);
  const line = data.timeline;

  // ---------------------------------------------------------------- the telegrams, column by column (asi/trace.py)
  const REPEATED = 1, REQUEST_OK = 2, PROBE = 8, NONE = 255, NO_DEVIATION = -32768;
  const REQUEST_NS = 79500, ANSWER_NS = 37500, LAST_NS = 78000, HALF_NS = 3000, PULSE_NS = 1500;
  const bytes = Uint8Array.from(atob(line.rows), (c) => c.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  const count = bytes.length / line.row_bytes;
  const time = new Float64Array(count), delay = new Int32Array(count), call = new Uint16Array(count);
  const requestDev = new Int16Array(count), answerDev = new Int16Array(count);
  const cls = new Uint8Array(count), answer = new Uint8Array(count);
  const phase = new Uint8Array(count), flags = new Uint8Array(count);
  for (let i = 0, at = 0; i < count; i++, at += line.row_bytes) {
    time[i] = view.getFloat64(at, true);
    delay[i] = view.getInt32(at + 8, true);
    requestDev[i] = view.getInt16(at + 12, true);
    answerDev[i] = view.getInt16(at + 14, true);
    call[i] = view.getUint16(at + 16, true);
    cls[i] = bytes[at + 18];
    answer[i] = bytes[at + 19];
    phase[i] = bytes[at + 20];
    flags[i] = bytes[at + 21];
  }
  const calls = line.calls.map(([name, address, index, bits, word]) =>
    ({name, address, index, bits, word, family: family(name)}));
  const run = data.report.run;
  const begin = run ? 0 : data.report.begin_ns;
  const end = Math.max(run ? run.bus_time_ns : data.report.end_ns, count ? time[count - 1] + 150000 : 0, begin + 1000);

  function family(name) {
    if (name === "DEXG") return "dexg";
    if (name === "WPAR") return "par";
    if (/^(RDIO|RDID|RID1|RID2|RDST)$/.test(name)) return "read";
    return /^(ADRA|DELA|WID1|PRGM)$/.test(name) ? "addr" : "other";
  }
  const className = (c) => line.classes[c] || "?";
  const isProbe = (i) => (flags[i] & PROBE) !== 0;
  const isError = (i) => (cls[i] !== 0 || !(flags[i] & REQUEST_OK)) && (!isProbe(i) || byId("probes").checked);
  const fails = (i) => (cls[i] !== 0 || !(flags[i] & REQUEST_OK)) && !isProbe(i);
  const wanted = (i) => filter === null || calls[call[i]].index === filter;
  const answers = (i) => delay[i] >= 0 && (flags[i] & REQUEST_OK) !== 0;
  const endOf = (i) => answers(i) ? time[i] + LAST_NS + delay[i] + ANSWER_NS : time[i] + REQUEST_NS;

  function firstFrom(t) {          // number of telegrams that begin before t
    let low = 0, high = count;
    while (low < high) {
      const mid = (low + high) >> 1;
      if (time[mid] < t) low = mid + 1; else high = mid;
    }
    return low;
  }

  // ---------------------------------------------------------------- colours follow the style sheet, light or dark
  let colours = {};
  function readColours() {
    const style = getComputedStyle(document.documentElement);
    colours = new Proxy({}, {get: (seen, name) => seen[name] ||= style.getPropertyValue("--" + name).trim()});
  }
  const errorColour = (i) => flags[i] & REQUEST_OK ? colours["e" + cls[i]] || colours.e15 : colours.e15;

  // ---------------------------------------------------------------- view
  const chart = byId("chart"), overview = byId("overview");
  const SHORTEST_NS = 30000;
  let from = begin, to = end, chosen = -1, pointed = -1, filter = null, wide = 0;
  const LANES = {band: [4, 16], marks: [24, 12], ask: [44, 76], reply: [126, 76], axis: [208, 28]};

  function show(a, b) {
    let span = Math.min(Math.max(b - a, SHORTEST_NS), end - begin);
    from = Math.min(Math.max(a, begin), end - span);
    to = from + span;
    if (!pending) pending = requestAnimationFrame(draw);
  }
  const zoom = (factor, t = (from + to) / 2) => show(t - (t - from) * factor, t + (to - t) * factor);
  const pan = (part) => show(from + (to - from) * part, to + (to - from) * part);
  let pending = 0;

  function fit(canvas) {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const g = canvas.getContext("2d");
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.fillStyle = colours.card;
    g.fillRect(0, 0, width, height);
    return [g, width, height];
  }

  function fitText(g, text, x, y, width, ...shorter) {  // as much of a text as fits, nothing when that is too little
    if (width < 12) return;
    const fits = [text, ...shorter].find((one) => g.measureText(one).width <= width);
    if (fits !== undefined) { g.fillText(fits, x, y); return; }
    if (width < 40) return;
    while (text && g.measureText(text + "…").width > width) text = text.slice(0, -1);
    if (text) g.fillText(text + "…", x, y);
  }

  function draw() {
    pending = 0;
    const [g, width] = fit(chart);
    wide = width;
    const x = (t) => (t - from) / (to - from) * width;
    const nsPerPx = (to - from) / width;
    g.font = "12px system-ui, sans-serif";
    g.textBaseline = "middle";
    drawGaps(g, x);
    g.strokeStyle = colours.line;
    for (const lane of ["ask", "reply"]) {
      const y = LANES[lane][0] + LANES[lane][1] + .5;
      g.beginPath(); g.moveTo(0, y); g.lineTo(width, y); g.stroke();
    }
    const first = firstFrom(from - 400000), last = firstFrom(to);
    drawBand(g, x, width, nsPerPx > 60000 ? [] : [first, last]);
    drawEvents(g, x);
    if (nsPerPx > 60000) drawDense(g, first, last, width, nsPerPx);
    else drawBlocks(g, x, first, last, nsPerPx);
    drawAxis(g, width);
    g.fillStyle = colours.dim;
    g.font = "11px system-ui, sans-serif";
    if (nsPerPx > 60000) label(g, "requests", 4, LANES.ask[0] + 8), label(g, "answers", 4, LANES.reply[0] + 8);
    drawOverview();
    chart.dataset.from = from;
    chart.dataset.to = to;
    chart.dataset.chosen = chosen;
  }

  function label(g, text, x, y) {
    const width = g.measureText(text).width;
    g.globalAlpha = .8; g.fillStyle = colours.card; g.fillRect(x - 2, y - 7, width + 4, 14);
    g.globalAlpha = 1; g.fillStyle = colours.dim; g.fillText(text, x, y);
  }

  // slices of which only errors and special calls are here
  function drawGaps(g, x) {
    if (line.every === 1) return;
    g.fillStyle = colours.soft;
    const slice = line.slice_ns, whole = slice * line.every;
    if (x(whole) - x(0) < 3) return;
    for (let t = Math.floor(from / whole) * whole; t < to; t += whole) {
      const x0 = x(t + slice), x1 = x(t + whole);
      g.fillRect(x0, LANES.ask[0], x1 - x0, LANES.reply[0] + LANES.reply[1] - LANES.ask[0]);
    }
  }

  function drawBand(g, x, width, [first, last]) {
    const [y, height] = LANES.band, names = [];
    for (const [t0, t1, name] of line.phases) {
      const x0 = Math.max(0, x(t0)), x1 = Math.min(width, Math.max(x(t1), x(t0) + 1));
      if (x1 < 0 || x0 > width || !name) continue;
      g.fillStyle = colours["p-" + name.toLowerCase()] || colours.soft;
      g.fillRect(x0, y, x1 - x0, height);
      names.push([name === "CYCLES" ? "cyclic operation" : name, x0, x1]);
    }
    for (let i = first; i < last; i++) {    // inside a cycle, until the next call
      const name = line.phase_names[phase[i]], t1 = i + 1 < count ? Math.min(time[i + 1], time[i] + 160000) : endOf(i);
      if (name !== "INCLUSION" && name !== "MANAGEMENT") continue;
      g.fillStyle = colours["p-" + name.toLowerCase()];
      g.fillRect(x(time[i]), y, Math.max(1, x(t1) - x(time[i])), height);
      if (x(t1) - x(time[i]) > 70) names.push([name, x(time[i]), x(t1)]);
    }
    g.fillStyle = colours.text;
    for (const [name, x0, x1] of names) fitText(g, name, x0 + 5, y + height / 2 + .5, x1 - x0 - 8);
  }

  const MARKS = {check: "good", slave: "c-read", phase: "dim", world: "e4", host: "accent",
                 input: "c-answer", output: "c-dexg"};
  function drawEvents(g, x) {
    const [y, height] = LANES.marks;
    let last = -9, kind = "";
    for (const [t, what, text] of line.events) {
      const at = x(t);
      if (at < -8 || (at - last < 1 && what === kind)) continue;
      if (at > wide + 8) break;
      const small = what === "input" || what === "output";
      g.fillStyle = what === "check" && text.includes("not met") ? colours.bad : colours[MARKS[what] || "dim"];
      g.beginPath();
      g.moveTo(at, y + height); g.lineTo(at - 4, y + (small ? 5 : 0)); g.lineTo(at + 4, y + (small ? 5 : 0)); g.fill();
      last = at; kind = what;
    }
  }

  const FAMILIES = ["dexg", "par", "read", "addr", "other"];
  function drawDense(g, first, last, width, nsPerPx) {
    const columns = Math.ceil(width) + 1;
    const asked = new Uint32Array(columns * 5), good = new Uint32Array(columns), bad = new Uint32Array(columns);
    const idle = new Uint32Array(columns), colour = new Array(columns);
    let most = 1;
    for (let i = first; i < last; i++) {
      const k = Math.floor((time[i] - from) / nsPerPx);
      if (k < 0 || k >= columns || !wanted(i)) continue;
      asked[5 * k + FAMILIES.indexOf(calls[call[i]].family)]++;
      if (fails(i)) { bad[k]++; colour[k] = errorColour(i); } else if (isProbe(i)) idle[k]++; else good[k]++;
      most = Math.max(most, good[k] + bad[k] + idle[k]);
    }
    const stack = (lane, k, parts) => {
      let [y, height] = LANES[lane];
      y += height;
      for (const [number, fill] of parts) {
        if (!number) continue;
        const tall = Math.max(1, number / most * (height - 4));
        g.fillStyle = fill;
        g.fillRect(k, y - tall, 1, tall);
        y -= tall;
      }
    };
    for (let k = 0; k < columns; k++) {
      stack("ask", k, FAMILIES.map((name, n) => [asked[5 * k + n], colours["c-" + name]]));
      stack("reply", k, [[good[k], colours["c-answer"]], [idle[k], colours["c-probe"]]]);
    }
    for (let k = 0; k < columns; k++) {     // on top and wide enough to be seen
      if (!bad[k]) continue;
      const [y, height] = LANES.reply, tall = Math.max(6, bad[k] / most * (height - 4));
      g.fillStyle = colour[k];
      g.fillRect(k - .5, y + height - tall, 2, tall);
    }
  }

  function drawBlocks(g, x, first, last, nsPerPx) {
    for (const late of [false, true]) {     // errors last: nothing hides them
      for (let i = first; i < last; i++) {
        if (fails(i) === late) drawTelegram(g, x, i, nsPerPx);
      }
    }
  }

  function drawTelegram(g, x, i, nsPerPx) {
    const it = calls[call[i]], ok = (flags[i] & REQUEST_OK) !== 0, who = `${it.name} ${it.address || "all"}`;
    g.globalAlpha = wanted(i) ? 1 : .18;
    const next = i + 1 < count ? time[i + 1] : Infinity;
    const blockEnd = Math.min(time[i] + REQUEST_NS, next);
    const fill = ok ? colours["c-" + it.family] : colours.e15;
    block(g, "ask", x(time[i]), x(blockEnd), fill, it.word, 14, nsPerPx,
          (ok ? who + (it.bits ? " " + it.bits : "") : `bad request ${className(cls[i])}`) +
          (flags[i] & REPEATED ? " repeated" : ""), flags[i] & REPEATED, ok ? [who, it.address || "all"] : []);
    if (!ok) { g.globalAlpha = 1; return; }
    if (answers(i)) {
      const t = time[i] + LAST_NS + delay[i], good = answer[i] !== NONE;
      block(g, "reply", x(t), x(t + ANSWER_NS), good ? colours["c-answer"] : errorColour(i),
            good ? answer[i] : null, 7, nsPerPx, good ? bits4(answer[i]) : className(cls[i]));
    } else if (cls[i] !== 0) {              // the time in which nobody answered
      const [y, height] = LANES.reply, x0 = x(time[i] + LAST_NS), x1 = x(Math.min(time[i] + LAST_NS + 66000, next));
      const w = Math.max(x1 - x0, 1);
      g.fillStyle = isProbe(i) ? colours["c-probe"] : errorColour(i);
      g.fillRect(x0, y + height - (isProbe(i) ? 8 : 20), w, isProbe(i) ? 8 : 20);
      g.fillStyle = colours.text;
      fitText(g, isProbe(i) ? "nobody" : className(cls[i]), x0 + 2, y + height - 30, w);
    }
    if (i === chosen) {
      g.strokeStyle = colours.text;
      g.lineWidth = 2;
      const x0 = x(time[i]), w = Math.max(4, x(Math.max(endOf(i), time[i] + REQUEST_NS)) - x0);
      g.strokeRect(x0 - 1, LANES.ask[0] - 1, w + 2, LANES.reply[0] + LANES.reply[1] - LANES.ask[0] + 2);
      g.lineWidth = 1;
    }
    g.globalAlpha = 1;
  }

  // one telegram in its lane: a block, with text where there is room, with its pulses where there is more
  function block(g, lane, x0, x1, fill, value, bits, nsPerPx, text, striped, shorter = []) {
    const [y, height] = LANES[lane], width = Math.max(x1 - x0, 1), near = nsPerPx < 450;
    const top = near ? y + 2 : y + 14, tall = near ? 18 : height - 14;
    g.fillStyle = fill;
    g.fillRect(x0, top, width, tall);
    if (striped && width > 6) {
      g.fillStyle = colours.card;
      for (let s = x0 + 2; s < x0 + width - 2; s += 6) g.fillRect(s, top + 1, 3, 2);
    }
    if (!near) {
      g.fillStyle = colours.card;
      fitText(g, text, x0 + 3, top + tall / 2, width - 5, ...shorter);
      return;
    }
    g.fillStyle = colours.card;
    fitText(g, text, x0 + 4, top + tall / 2 + .5, width - 6, ...shorter);
    if (value === null || value === undefined) return;
    const word = telegramWord(value), middle = y + 41, swing = 15;
    g.strokeStyle = fill;
    g.beginPath();
    let at = x0;
    g.moveTo(at, middle);
    const pulse = (k, sign) => {
      const p0 = x0 + k * HALF_NS / nsPerPx, p1 = p0 + PULSE_NS / nsPerPx;
      const bow = (p1 - p0) * .35, top = middle - sign * swing * 1.3;
      g.lineTo(p0, middle);
      g.bezierCurveTo(p0 + bow, top, p1 - bow, top, p1, middle);
    };
    for (let k = 0; k < bits; k++) {
      const bit = word >> (bits - 1 - k) & 1, after = k + 1 < bits ? word >> (bits - 2 - k) & 1 : -1;
      pulse(2 * k, bit ? 1 : -1);
      if (after === bit) pulse(2 * k + 1, bit ? -1 : 1);
    }
    g.lineTo(x1, middle);
    g.lineWidth = 1.5; g.stroke(); g.lineWidth = 1;
    if (2 * HALF_NS / nsPerPx > 11) {
      g.fillStyle = colours.dim;
      for (let k = 0; k < bits; k++) {
        g.fillText(String(word >> (bits - 1 - k) & 1), x0 + 2 * k * HALF_NS / nsPerPx - 1, y + height - 9);
      }
    }
  }
  const ones = (word) => { let n = 0; for (; word; word >>= 1) n ^= word & 1; return n; };
  const telegramWord = (value) => value << 2 | ones(value) << 1 | 1;
  const bits4 = (value) => value.toString(2).padStart(4, "0");

  const UNITS = [[1e9, "s"], [1e6, "ms"], [1e3, "µs"]];
  function drawAxis(g, width) {
    const goal = (to - from) / Math.max(2, width / 110);
    let step = 10 ** Math.floor(Math.log10(goal));
    step *= [1, 2, 5, 10].find((n) => n * step >= goal);
    const [unit, name] = UNITS.find(([ns]) => step >= ns && to >= ns) || UNITS[2];
    const digits = Math.max(0, Math.ceil(-Math.log10(step / unit) - 1e-9));
    const [y] = LANES.axis;
    g.strokeStyle = colours.line;
    g.fillStyle = colours.dim;
    g.font = "12px system-ui, sans-serif";
    for (let t = Math.ceil(from / step) * step; t < to; t += step) {
      const at = (t - from) / (to - from) * width;
      g.beginPath(); g.moveTo(at, y); g.lineTo(at, y + 5); g.stroke();
      const text = (t / unit).toFixed(digits) + " " + name, w = g.measureText(text).width;
      g.fillText(text, Math.min(Math.max(at - w / 2, 2), width - w - 2), y + 16);
    }
  }

  function drawOverview() {
    const [g, width, height] = fit(overview);
    const scale = width / (end - begin), columns = Math.ceil(width) + 1;
    const all = new Uint32Array(columns), bad = new Uint8Array(columns);
    let most = 1;
    for (let i = 0; i < count; i++) {
      const k = Math.floor((time[i] - begin) * scale);
      if (k < 0 || k >= columns || !wanted(i)) continue;
      all[k]++;
      if (fails(i)) bad[k] = 1;
      most = Math.max(most, all[k]);
    }
    for (const [t0, t1, name] of line.phases) {
      if (!name) continue;
      g.fillStyle = colours["p-" + name.toLowerCase()] || colours.soft;
      g.fillRect((t0 - begin) * scale, 0, Math.max(1, (t1 - t0) * scale), 5);
    }
    g.fillStyle = colours["c-dexg"];
    for (let k = 0; k < columns; k++) if (all[k]) g.fillRect(k, height - all[k] / most * 28, 1, all[k] / most * 28);
    g.fillStyle = colours.e1;
    for (let k = 0; k < columns; k++) if (bad[k]) g.fillRect(k - .5, 8, 2, 8);
    const x0 = (from - begin) * scale, w = Math.max(4, (to - from) * scale);
    g.fillStyle = colours.accent; g.globalAlpha = .16; g.fillRect(x0, 0, w, height);
    g.globalAlpha = 1; g.strokeStyle = colours.accent; g.lineWidth = 2;
    g.strokeRect(x0 + 1, 1, w - 2, height - 2); g.lineWidth = 1;
  }

  // ---------------------------------------------------------------- one telegram in words
  const IDLE = byId("detail").textContent;
  const us = (ns) => (ns / 1000).toFixed(3);
  function describe(i) {
    const it = calls[call[i]], ok = (flags[i] & REQUEST_OK) !== 0, out = [];
    out.push(["", us(time[i]) + " µs"]);
    out.push(["", ok ? `${it.name} ${it.address || "to all"}` : "bad request"]);
    const row = data.report.slaves.find((slave) => slave.index === it.index && it.index !== null);
    if (row && row.name) out.push(["", row.name]);
    if (it.bits) out.push(["data ", it.bits]);
    if (ok && answer[i] !== NONE) out.push(["answer ", bits4(answer[i])]);
    out.push(["", isProbe(i) ? "nobody answered (looking for slaves)" : className(cls[i])]);
    if (answers(i)) out.push(["delay ", us(delay[i]) + " µs"]);
    if (requestDev[i] !== NO_DEVIATION) out.push(["request pulses off by up to ", us(requestDev[i]) + " µs"]);
    if (answerDev[i] !== NO_DEVIATION) out.push(["answer pulses by up to ", us(answerDev[i]) + " µs"]);
    if (flags[i] & REPEATED) out.push(["", "repetition"]);
    if (phase[i] !== NONE) out.push(["phase ", line.phase_names[phase[i]] || phase[i]]);
    return out;
  }
  function tell() {
    const i = pointed >= 0 ? pointed : chosen, place = byId("detail");
    if (i < 0) {
      place.textContent = IDLE;
      delete place.dataset.telegram;
      return;
    }
    place.replaceChildren(...describe(i).flatMap(([name, value], k) => {
      const strong = document.createElement(k < 2 ? "b" : "span");
      strong.textContent = value;
      return [k ? "  ·  " : "", name, strong];
    }));
    place.dataset.telegram = i;
  }

  function choose(i, bring = true) {
    chosen = i;
    pointed = -1;
    if (i >= 0 && bring) {
      const span = Math.min(to - from, 5e6), mid = time[i] + 70000;
      if (time[i] < from || endOf(i) > to || to - from > 5e6) show(mid - span / 2, mid + span / 2);
    }
    show(from, to);
    tell();
    say();
  }

  function find(step, test) {      // the next telegram from the chosen one, else from what is on screen
    let i = chosen >= 0 ? chosen + step : step > 0 ? firstFrom(from) : firstFrom(to) - 1;
    while (i >= 0 && i < count && !(wanted(i) && test(i))) i += step;
    if (i >= 0 && i < count) choose(i); else say(step > 0 ? "none after this" : "none before this");
  }
  const stepError = (step) => find(step, isError);
  const stepAny = (step) => find(step, () => true);

  function say(note = "") {
    let number = 0, at = 0;
    for (let i = 0; i < count; i++) {
      if (!wanted(i) || !isError(i)) continue;
      number++;
      if (i <= chosen) at = number;
    }
    const here = chosen >= 0 && isError(chosen) && wanted(chosen);
    byId("counter").textContent = (here ? `${at} of ` : "") + `${number} error${number === 1 ? "" : "s"}` +
      (note ? ", " + note : "");
    byId("counter").dataset.errors = number;
  }

  function setFilter(index) {
    filter = index;
    byId("address").value = index === null ? "" : String(index);
    chosen = -1;
    say();
    show(from, to);
  }

  // ---------------------------------------------------------------- mouse, touch
  const timeAt = (event) => from + (event.clientX - chart.getBoundingClientRect().left) / wide * (to - from);
  function telegramAt(event) {
    const t = timeAt(event), slack = (to - from) / wide * 3;
    if (slack > 600000) return -1;
    const hit = (i) => i >= 0 && i < count && wanted(i) && time[i] - slack <= t &&
      t <= Math.max(endOf(i), time[i] + 144000) + slack;
    const i = firstFrom(t) - 1;
    return hit(i) ? i : hit(i + 1) ? i + 1 : -1;
  }
  chart.addEventListener("wheel", (event) => {
    const out = event.deltaY > 0;
    if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
      pan((event.deltaX || event.deltaY) / wide);
    } else {
      if (out && to - from >= end - begin) return;  // nothing left to zoom out of: the page scrolls on
      zoom(1.0018 ** Math.max(-400, Math.min(400, event.deltaY)), timeAt(event));
    }
    event.preventDefault();
  }, {passive: false});

  const fingers = new Map();
  let moved = 0;
  chart.addEventListener("pointerdown", (event) => {
    fingers.set(event.pointerId, event.clientX);
    chart.setPointerCapture(event.pointerId);
    if (fingers.size === 1) moved = 0;
    chart.classList.add("drag");
  });
  chart.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) {
      const i = telegramAt(event);
      if (i !== pointed) { pointed = i; tell(); }
      return;
    }
    const before = fingers.get(event.pointerId), left = chart.getBoundingClientRect().left;
    if (fingers.size === 1) {
      moved += Math.abs(event.clientX - before);
      if (moved > 3) pan((before - event.clientX) / wide);
    } else {
      const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
      const wasApart = Math.max(8, Math.abs(before - other)), apart = Math.max(8, Math.abs(event.clientX - other));
      moved += 9;
      zoom(wasApart / apart, from + (other - left) / wide * (to - from));
    }
    fingers.set(event.pointerId, event.clientX);
  });
  const lift = (event) => {
    const was = fingers.delete(event.pointerId);
    if (!fingers.size) chart.classList.remove("drag");
    if (was && event.type === "pointerup" && moved <= 3) {
      const i = telegramAt(event);
      if (i >= 0) choose(i, false); else if (to - from > 5e6) zoom(.1, timeAt(event));
    }
  };
  chart.addEventListener("pointerup", lift);
  chart.addEventListener("pointercancel", lift);
  chart.addEventListener("pointerleave", () => { if (pointed >= 0) { pointed = -1; tell(); } });

  const centre = (event) => {
    const box = overview.getBoundingClientRect(), t = begin + (event.clientX - box.left) / box.width * (end - begin);
    show(t - (to - from) / 2, t + (to - from) / 2);
  };
  overview.addEventListener("pointerdown", (event) => { overview.setPointerCapture(event.pointerId); centre(event); });
  overview.addEventListener("pointermove", (event) => { if (event.buttons) centre(event); });

  // ---------------------------------------------------------------- keys, buttons
  const whole = () => show(begin, end);
  const KEYS = {
    "+": () => zoom(.5), "=": () => zoom(.5), "-": () => zoom(2), ArrowLeft: () => pan(-.2), ArrowRight: () => pan(.2),
    PageUp: () => pan(-1), PageDown: () => pan(1), Home: whole, n: () => stepError(1), p: () => stepError(-1),
    ".": () => stepAny(1), ",": () => stepAny(-1), Escape: () => choose(-1),
    Enter: () => {
      if (chosen >= 0) show(time[chosen] - 30000, Math.max(endOf(chosen), time[chosen] + 150000) + 30000);
    },
  };
  chart.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || !KEYS[event.key]) return;
    KEYS[event.key]();
    event.preventDefault();
  });
  const press = (id, work) => byId(id).addEventListener("click", work);
  press("whole", whole);
  press("zoom-in", () => zoom(.5));
  press("zoom-out", () => zoom(2));
  press("left", () => pan(-.5));
  press("right", () => pan(.5));
  press("error-next", () => stepError(1));
  press("error-before", () => stepError(-1));
  press("step-next", () => stepAny(1));
  press("step-before", () => stepAny(-1));
  byId("probes").addEventListener("change", () => say());

  const seen = new Map();
  for (const it of calls) if (it.index !== null) seen.set(it.index, it.address);
  for (const index of [...seen.keys()].sort((a, b) => (a & 31) - (b & 31) || a - b)) {
    const name = (data.report.slaves.find((slave) => slave.index === index) || {}).name;
    byId("address").add(new Option(name ? `${seen.get(index)}  ${name}` : seen.get(index), String(index)));
  }
  byId("address").addEventListener("change", (event) =>
    setFilter(event.target.value === "" ? null : Number(event.target.value)));
  for (const button of document.querySelectorAll("button.find")) {
    button.addEventListener("click", () => {
      if (!seen.has(Number(button.dataset.find))) return;
      setFilter(Number(button.dataset.find));
      byId("timeline").scrollIntoView({block: "nearest"});
      chart.focus({preventScroll: true});
    });
  }
  for (const button of document.querySelectorAll("button.goto")) {
    button.addEventListener("click", () => {
      const t = Number(button.dataset.t), half = Math.min(5e6, to - from) / 2;
      show(t - half, t + half);
      byId("timeline").scrollIntoView({block: "nearest"});
      chart.focus({preventScroll: true});
    });
  }

  // ---------------------------------------------------------------- sorting
  for (const table of document.querySelectorAll("table.sort")) {
    const heads = [...table.tHead.rows[0].cells], body = table.tBodies[0];
    heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => {
      const numeric = column === 0 || head.classList.contains("num");
      const up = head.getAttribute("aria-sort") ? head.getAttribute("aria-sort") !== "ascending" : !numeric;
      for (const other of heads) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const key = (row) => row.cells[column].dataset.v;
      const compare = (a, b) => {
        const [x, y] = [key(a), key(b)], none = (v) => v === "" || v === "null";
        if (none(x) || none(y)) return none(x) - none(y);       // what is not there stays below
        return (numeric ? x - y : x.localeCompare(y)) * (up ? 1 : -1);
      };
      body.append(...[...body.rows].sort(compare));
    }));
  }

  // ---------------------------------------------------------------- legend and start
  function legend() {
    const entries = [], add = (fill, text) => entries.push([fill, text]);
    const names = new Set(calls.map((it) => it.family)), failed = new Set();
    let probe = false;
    for (let i = 0; i < count; i++) {
      if (fails(i)) failed.add(flags[i] & REQUEST_OK ? cls[i] : 15);
      else probe ||= isProbe(i);
    }
    const titles = {dexg: "DEXG", par: "WPAR", read: "read calls", addr: "addressing", other: "other calls"};
    for (const name of FAMILIES) if (names.has(name)) add("c-" + name, titles[name]);
    add("c-answer", "good answer");
    if (probe) add("c-probe", "unanswered probe");
    for (const c of [...failed].sort((a, b) => a - b)) add("e" + c, c === 15 ? "bad request" : className(c));
    byId("legend").replaceChildren(...entries.map(([fill, text]) => {
      const item = document.createElement("span"), box = document.createElement("i");
      box.style.background = `var(--${fill})`;
      item.append(box, text);
      return item;
    }));
  }
  readColours();
  legend();
  say();
  show(count ? time[0] - (endOf(count - 1) - time[0]) * .02 : begin, count ? endOf(count - 1) : end);
  new ResizeObserver(() => show(from, to)).observe(chart);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { readColours(); show(from, to); });
  addEventListener("beforeprint", () => { readColours(); draw(); });
  document.documentElement.dataset.ready = "1";
})();
