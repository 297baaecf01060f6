// What the timeline draws, and how it says it.

const EASE = { linear: (p) => p, smooth: (p) => p * p * (3 - 2 * p), in: (p) => p * p, out: (p) => 1 - (1 - p) ** 2 };
const APART_PX = 70;

// Where a pointer is in an svg whose units are px.
export function place(svg, event) {
  const box = svg.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
}

// Full moments, ms, that are far enough apart to be written.
export function ticks(from, to, scale) {
  const apart = [10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 30000, 60000, 300000, 600000].find((ms) => ms * scale > APART_PX) || 3600000;
  const found = [];
  for (let tick = Math.max(Math.ceil(from / apart), 0) * apart; tick <= to; tick += apart) found.push(tick);
  return found;
}

// What is asked of a bubble over time, as a path in a track whose top is given.
export function curve(doc, bubble, x, down) {
  const points = [[x(0), down(doc.low)]];
  let now = doc.low;
  for (const step of doc.steps) {
    const to = step.targets?.[bubble] ?? now;
    points.push([x(step.begin), down(now)]);
    const parts = to === now || step.easing === "linear" ? 1 : 8;
    for (let part = 1; part <= parts; part++) {
      const p = part / parts;
      points.push([x(step.begin + (step.arrival - step.begin) * p), down(now + (to - now) * EASE[step.easing](p))]);
    }
    points.push([x(step.end), down(to)]);
    now = to;
  }
  return (top) => `M${points.map(([u, v]) => `${u.toFixed(1)} ${(top + v).toFixed(1)}`).join("L")}`;
}

// A step in words, for those who hear it.
export function label(doc, s, outlook) {
  const step = doc.steps[s];
  const on = step.settled ? `until settled within ${step.settled[0]} mm, for ${step.settled[1]} s at most` : `then ${step.after} s`;
  const what = step.targets ? `${step.ramp} s ramp, ${step.easing}` : `waits ${step.ramp} s`;
  const marks = [outlook.passes.has(s) && "past the limit", outlook.never.has(s) && "never played"].filter(Boolean);
  return [`Step ${s}${step.name ? `, ${step.name}` : ""}: ${what}`, on, ...marks].join(", ");
}
