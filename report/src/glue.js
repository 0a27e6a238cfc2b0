// Makes uPlot charts of the descriptions in this page; drawn here are only the marks and the paths of planes.
"use strict";
// Strings as a reader can see them: control characters and others without a picture as escapes, as everywhere in the page.
const seen = (key, value) =>
  typeof value != "string" ? value : value.replace(/[\p{Cc}\p{Cf}\p{Co}\p{Cn}\p{Zl}\p{Zp}]/gu, c =>
    [...Array(c.length).keys()].map(k => "\\u" + c.charCodeAt(k).toString(16).padStart(4, "0")).join(""));
(() => {
  const COLOURS = 8; // as many as report.css has
  const root = document.documentElement;
  const css = name => getComputedStyle(root).getPropertyValue(name).trim();
  const font = size => `${size}px system-ui, sans-serif`;
  const colourName = series => `--series-${series.colour % COLOURS}`;
  const dashes = series => (series.dashed || series.colour >= COLOURS ? [7, 4] : undefined);

  // ---- numbers ----
  const short = (value, digits) => String(+value.toPrecision(digits));

  // x of a percentile axis is 1 / (1 - p): 1 is 0 %, 10 is 90 %, 1000 is 99.9 %.
  function percent(x, moreDigits) {
    const decimals = Math.max(0, Math.ceil(Math.log10(x) - 2 - 1e-9)) + moreDigits;
    return `${(100 * (1 - 1 / x)).toFixed(Math.min(decimals, 12))} %`;
  }

  function hovered(axis, value, digits) {
    if (value == null) return "–";
    return axis.scale === "percentile" ? percent(value, 2) : short(value, digits) + (axis.unit && ` ${axis.unit}`);
  }

  // ---- axes and scales ----
  const isLog = axis => axis.scale !== "linear";
  const scaleOf = (axis, range) => ({ time: false, distr: isLog(axis) ? 3 : 1, range });
  const rangeOf = (axis, min, max, pad) =>
    isLog(axis) ? uPlot.rangeLog(min, max, 10, false) : uPlot.rangeNum(min, max, pad, true);

  const percentileSplits = (u, axis, min, max) =>
    Array.from({ length: 13 }, (_, power) => (max / min < 300 ? [1, 2, 5] : [1]).map(factor => factor * 10 ** power))
      .flat().filter(x => x >= min && x <= max);

  function axisOptions(axis, across, space) {
    const line = (colour, more) => ({ show: true, stroke: () => css(colour), width: 1, ...more });
    const options = {
      scale: across ? "x" : "y", side: across ? 2 : 3, label: axis.label, labelSize: 22, labelGap: 2, gap: 4, space,
      font: font(12), labelFont: font(12), stroke: () => css("--soft"),
      grid: line("--hair"), ticks: line("--hair", { size: 4 }), border: line("--soft"),
      size: across ? 28 : (u, labels) => 14 + 7 * Math.max(3, ...(labels ?? []).map(label => (label ?? "").length)),
      values: (u, splits) => splits.map(v => (v == null ? null : short(v, 6))),
    };
    if (axis.scale !== "percentile") return options;
    const every = (u, splits) => Math.ceil(65 * splits.length / u.width); // how many ticks share one label
    const values = (u, splits) => splits.map((x, i) => (i % every(u, splits) ? null : percent(x, 0)));
    return { ...options, splits: percentileSplits, filter: (u, splits) => splits, values };
  }

  // ---- marks: lines and bands behind the series ----
  function drawMarks(u, marks) {
    const { ctx } = u, { left, top, width, height } = u.bbox, dot = uPlot.pxRatio;
    const ends = []; // where the labels along the top end, line by line
    const write = (label, from) => {
      const long = ctx.measureText(label).width;
      const x = Math.min(Math.max(from, left) + 4 * dot, left + width - long);
      let line = 0;
      while (ends[line] > x) line += 1;
      if (label) ends[line] = x + long + 4 * dot;
      ctx.fillText(label, x, top + (5 + 15 * line) * dot);
    };
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    Object.assign(ctx, { font: font(12 * dot), textAlign: "left", textBaseline: "top", fillStyle: css("--mark") });
    for (const { from, to, y, label } of marks) {
      if (y != null) {
        const high = u.valToPos(y, "y", true);
        ctx.fillRect(left, high - dot / 2, width, dot);
        ctx.fillText(label, left + 6 * dot, high < top + 20 * dot ? high + 4 * dot : high - 15 * dot);
      } else {
        const [start, end] = [from, to].map(x => u.valToPos(x, "x", true));
        ctx.globalAlpha = from === to ? 1 : 0.15;
        ctx.fillRect(start, top, Math.max(end - start, dot), height);
        ctx.globalAlpha = 1;
        write(label, start);
      }
    }
    ctx.restore();
  }

  // ---- traces: y as a function of x ----
  function trace(chart) {
    const { x, y } = chart;
    const yRange = (u, low, high) => {
      const min = Math.min(low ?? Infinity, ...chart.in_view), max = Math.max(high ?? -Infinity, ...chart.in_view);
      return min <= max ? rangeOf(y, min, max, 0.1) : [0, 1];
    };
    const xRange = isLog(x) ? (u, low, high) => (low < high ? [low, high] : [low / 2, low * 2]) : undefined;
    const one = series => {
      const stroke = () => css(colourName(series));
      const dots = { size: 4, width: 0, stroke, fill: stroke };
      const styles = {
        line: { points: dots },
        step: { paths: uPlot.paths.stepped({ align: 1 }), points: { show: false } },
        bars: { paths: uPlot.paths.bars({ size: [0.9] }), fill: stroke, width: 0, points: { show: false } },
        points: { paths: () => null, points: { ...dots, show: true } },
      };
      const value = (u, v) => hovered(y, v, 4);
      return { label: series.name, stroke, width: 1.5, dash: dashes(series), value, ...styles[series.style] };
    };
    const options = {
      scales: { x: scaleOf(x, xRange), y: scaleOf(y, yRange) },
      series: [{ label: x.name, class: "across", value: (u, v) => hovered(x, v, 6) }, ...chart.series.map(one)],
    };
    return [options, uPlot.join(chart.series.map(series => [chart.grids[series.grid], series.y]))];
  }

  // ---- planes: points in any order ----
  function planePath(dots) {
    return (u, place) => {
      const path = new Path2D(), [xs, ys] = u.data[place], radius = 1.8 * uPlot.pxRatio;
      xs.forEach((value, i) => {
        if (value == null) return;
        const x = u.valToPos(value, "x", true), y = u.valToPos(ys[i], "y", true);
        if (dots) path.rect(x - radius, y - radius, 2 * radius, 2 * radius);
        else if (xs[i - 1] == null) path.moveTo(x, y);
        else path.lineTo(x, y);
      });
      return dots ? { fill: path } : { stroke: path };
    };
  }

  // The point of a series that is nearest to the cursor, within 30 pixels.
  function nearest(u, place) {
    const [xs, ys] = u.data[place], { left, top } = u.cursor;
    let found = null, least = 30 ** 2;
    xs.forEach((x, i) => {
      const distance = (u.valToPos(x, "x") - left) ** 2 + (u.valToPos(ys[i], "y") - top) ** 2;
      if (x != null && distance < least) [found, least] = [i, distance];
    });
    return found;
  }

  // All points in view; with equal axes both spans are the larger one.
  function wholeView(chart) {
    const span = (values, axis) => {
      const seen = values.filter(v => v != null), end = pick => seen.reduce((a, b) => pick(a, b));
      return rangeOf(axis, end(Math.min), end(Math.max), 0.05);
    };
    const x = span(chart.grids.flat(), chart.x);
    const y = span([...chart.series.flatMap(series => series.y), ...chart.in_view], chart.y);
    const half = Math.max(x[1] - x[0], y[1] - y[0]) / 2;
    const around = ([min, max]) => [(min + max) / 2 - half, (min + max) / 2 + half];
    return chart.equal ? { x: around(x), y: around(y) } : { x, y };
  }

  function plane(chart) {
    const whole = wholeView(chart);
    let view = whole;
    const show = (u, wanted) => {
      view = wanted;
      u.batch(() => ["x", "y"].forEach(key => u.setScale(key, { min: view[key][0], max: view[key][1] })));
    };
    const zoom = u => {
      const { left, top, width, height } = u.select;
      if (Math.min(width, height) < 5) return;
      u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
      const side = Math.max(width, height), [w, h] = chart.equal ? [side / 2, side / 2] : [width / 2, height / 2];
      const along = (key, middle, half) => [u.posToVal(middle - half, key), u.posToVal(middle + half, key)];
      show(u, { x: along("x", left + width / 2, w), y: along("y", top + height / 2, -h) });
    };
    const value = (u, _, place, i) =>
      i == null ? "–" : u.data[place].map((values, k) => hovered(k ? chart.y : chart.x, values[i], 4)).join(", ");
    const one = series => {
      const stroke = () => css(colourName(series)), dots = series.style === "points";
      const facets = [{ scale: "x", auto: true }, { scale: "y", auto: true }];
      const look = { stroke, fill: dots ? stroke : undefined, width: 1.2, dash: dashes(series), points: { show: false } };
      return { label: series.name, ...look, facets, paths: planePath(dots), value };
    };
    const options = {
      mode: 2,
      scales: { x: scaleOf(chart.x, () => view.x), y: scaleOf(chart.y, () => view.y) },
      series: [null, ...chart.series.map(one)],
      cursor: { dataIdx: nearest, drag: { y: true, setScale: false }, bind: { dblclick: u => () => show(u, whole) } },
      hooks: { setSelect: [zoom] },
    };
    return [options, [null, ...chart.series.map(series => [chart.grids[series.grid], series.y])]];
  }

  // ---- one chart ----
  function build(box, chart) {
    const [options, data] = chart.plane ? plane(chart) : trace(chart);
    const colour = (u, place) => `var(${colourName(chart.series[place - 1])})`;
    const dash = (u, place) => (dashes(chart.series[place - 1]) ? "dashed" : "solid");
    const sameName = (here, there, place) => here.series.findIndex(s => s?.label === there.series[place]?.label);
    const match = [(a, b) => a === b, () => false, sameName];
    const sync = { key: chart.group, setSeries: true, scales: ["x", null], match };
    options.cursor = { ...options.cursor, points: { size: 6, width: 1, stroke: colour, fill: colour } };
    if (chart.group && !chart.plane) options.cursor.sync = sync;
    options.hooks = { ...options.hooks, drawAxes: [u => drawMarks(u, chart.marks)] };
    const [xSpace, ySpace] = chart.equal ? [50, 50] : [60, 32];
    options.axes = [axisOptions(chart.x, true, xSpace), axisOptions(chart.y, false, ySpace)];
    options.legend = { markers: { width: 2, stroke: colour, fill: () => "none", dash } };
    options.padding = [8, isLog(chart.x) ? 30 : 12, 0, 0];
    const plot = new uPlot({ ...options, width: 600, height: chart.height }, data, box);
    for (const name of plot.root.querySelectorAll(".u-series:not(.across) th")) {
      Object.assign(name, { tabIndex: 0, role: "button", onkeydown: event => event.key === "Enter" && name.click() });
    }
    return { plot, chart };
  }

  // One unit is equally long on both axes when the plotting area is square.
  function fit({ plot, chart }, width) {
    if (!chart.equal) return plot.setSize({ width, height: chart.height });
    const side = Math.min(width, chart.height), excess = () => (plot.bbox.height - plot.bbox.width) / uPlot.pxRatio;
    plot.setSize({ width: side, height: side });
    queueMicrotask(() => plot.setSize({ width: side, height: side - excess() }));
  }

  // ---- the page ----
  const drawn = new Map(); // the charts by the boxes they stand in

  function draw(box, width) {
    if (width === 0) return; // folded away
    if (!drawn.has(box)) drawn.set(box, build(box, JSON.parse(box.nextElementSibling.textContent, seen)));
    fit(drawn.get(box), width);
  }

  function setTheme(name) {
    root.dataset.theme = name;
    drawn.forEach(({ plot }) => plot.redraw(false));
  }

  setTheme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  addEventListener("DOMContentLoaded", () => {
    const button = document.getElementById("theme");
    button.hidden = false;
    button.addEventListener("click", () => setTheme(root.dataset.theme === "dark" ? "light" : "dark"));
    const boxes = [...document.querySelectorAll(".plot")];
    const later = entries => requestAnimationFrame(() => entries.forEach(({ target }) => draw(target, target.clientWidth)));
    const observer = new ResizeObserver(later);
    boxes.forEach(box => observer.observe(box));

    // On paper: light, everything unfolded, charts as wide as the page.
    let theme;
    addEventListener("beforeprint", () => {
      theme = root.dataset.theme;
      setTheme("light");
      document.querySelectorAll("details").forEach(details => (details.open = true));
      boxes.forEach(box => draw(box, box.closest(".columns") ? 320 : 660));
    });
    addEventListener("afterprint", () => {
      setTheme(theme);
      boxes.forEach(box => draw(box, box.clientWidth));
    });
  });
})();
