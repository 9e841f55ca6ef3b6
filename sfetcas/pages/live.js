  /** Farthest that a place moves without a jump, parts of a long way, how much longer a part may be than others. */
  const JUMP = 0.05, PARTS = 8, SNAPS = 4;
  /** Milliseconds of a frame for steps, how often a step is halved, and speeds over that of the recorded motion. */
  const FRAME = 12, HALVINGS = 8, SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
  const DONE = 0, UNSTABLE = 1;

  /** The functions of the solver, of its zipped code. */
  const compiled = async (text) => {
    const bytes = new Blob([bytesOf(text)]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new WebAssembly.Instance(new WebAssembly.Module(await new Response(bytes).arrayBuffer()), {}).exports;
  };

  /** The solver in the page: of equilibria, each found from the one before, or of a motion, step by step. */
  function withSolver(given, code) {
    if (code._initialize) code._initialize();
    const size = (list) => list.reduce((sum, one) => Math.max(sum, one.first + one.size), 0), count = size(given.arguments);
    const results = new Float64Array(code.memory.buffer, code.live_results(), size(given.results));
    const inputs = new Float64Array(code.memory.buffer, code.live_arguments(), count * (given.times || [1]).length);
    const report = new DataView(code.memory.buffer, code.live_report_of(), 32);
    const defaults = new Float64Array(count);
    for (const one of given.arguments) defaults.set([].concat(one.default), one.first);
    const sentences = {}, fields = [], spent = { count: 0, time: 0 };
    for (const one of Object.values(given.statuses)) sentences[one.value] = one.meaning;
    // Until something is solved it is as the last state of the answer.
    const answer = states[known - 1], answered = linesOf(known - 1), here = { ...answer, kind: "live", labels: [] };
    let lines = Float64Array.from(answered);
    states.push(here);

    // -- symbols, carried from where they are in the answer -----------------------------------------------------------

    const minus = (a, b) => a.map((one, axis) => one - b[axis]);
    const unitOf = (way) => {
      const length = Math.hypot(...way) || 1;
      return way.map((one) => one / length);
    };
    /** The smallest rotation from a unit vector to another, as a function of vectors. */
    const turning = (from, to) => {
      const w = cross(from, to), c = 1 + dot(from, to);
      return (arm) => {
        const a = cross(w, arm), b = cross(w, a);
        return arm.map((one, axis) => (c < SMALL ? -one : one + a[axis] + b[axis] / c));
      };
    };
    const memberAt = members.flatMap((member, m) => member.x.map(() => m));
    const tangent = (line, i) => {
      const m = memberAt[i], [a, b] = [Math.max(i - 1, starts[m]), Math.min(i + 1, starts[m + 1] - 1)];
      return unitOf([0, 1, 2].map((axis) => line[3 * b + axis] - line[3 * a + axis]));
    };
    const beside = ([x, y, z]) => {
      let least = Infinity, found = 0;
      for (let i = 0; i < total; i++) {
        const off = (answered[3 * i] - x) ** 2 + (answered[3 * i + 1] - y) ** 2 + (answered[3 * i + 2] - z) ** 2;
        if (off < least) [least, found] = [off, i];
      }
      return found;
    };
    const holding = answer.symbols.map((number) => data.symbols[number]).filter((symbol) => !symbol.acts);
    const carried = holding.map((symbol) => {
      const vertices = symbol.points.length / 3, at = (k) => symbol.points.slice(3 * k, 3 * k + 3);
      if (symbol.stands && !symbol.carriers) return () => symbol;
      const moved = (node) => (node === null ? [0, 0, 0] : here.told.nodes[node].position.map((one, axis) => one - answer.told.nodes[node].position[axis]));
      const put = (place) => {
        const points = [];
        for (let k = 0; k < vertices; k++) points.push(...(symbol.points[3 * k] === null ? [null, null, null] : place(k)));
        return { ...symbol, points };
      };
      if (symbol.carriers) {
        const [node, other = node] = symbol.carriers, begin = answer.told.nodes[node].position, [first, last] = [at(0), at(vertices - 1)];
        const shifted = (place, by) => place.map((one, axis) => one + by[axis]);
        if (other === node) return () => put((k) => shifted(at(k), moved(node)));
        // What is not drawn from the node on is on the ground.
        if (Math.hypot(...minus(first, begin)) > 1e-3 * extent) return () => put((k) => shifted(at(k), moved(other)));
        // A spring stretches and turns with the line between its ends, and is as wide as before.
        const way = minus(last, first), share = (k) => dot(minus(at(k), first), way) / dot(way, way);
        return () => {
          const start = shifted(first, moved(node)), line = minus(shifted(last, moved(other)), start);
          const turned = turning(unitOf(way), unitOf(line));
          return put((k) => {
            const part = share(k), aside = turned(at(k).map((one, axis) => one - first[axis] - part * way[axis]));
            return start.map((one, axis) => one + part * line[axis] + aside[axis]);
          });
        };
      }
      const near = Array.from({ length: vertices }, (_, k) => beside(at(k)));
      return () => put((k) => {
        const i = near[k], arm = at(k).map((one, axis) => one - answered[3 * i + axis]);
        return turning(tangent(answered, i), tangent(lines, i))(arm).map((one, axis) => one + lines[3 * i + axis]);
      });
    });
    const carry = () => { here.symbols = carried.map((one) => one()); };
    carry();

    const timed = (call) => {
      const begin = performance.now(), status = call();
      spent.time += performance.now() - begin;
      spent.count += 1;
      return status;
    };
    const ownOf = (table, name) => (Object.hasOwn(table, name) ? table[name] : null);
    const named = new Map(given.results.map((one) => [one.name, one]));
    const piece = (name) => {
      const one = named.get(name);
      return one ? results.slice(one.first, one.first + one.size) : null;
    };
    /** Places of all members in the last solution. */
    const places = () => {
      const found = new Float64Array(3 * total);
      members.forEach((member, m) => {
        const own = piece(`members.${member.name}.position`);
        if (own) return found.set(own, 3 * starts[m]);
        const [a, b] = [member.nodes[0], member.nodes.at(-1)].map((node) => piece(`nodes.${node}.position`)), body = ownOf(given.bodies, member.name);
        const turned = body ? asBody(body, a, b) : () => a, end = turned(member.x.length - 1);
        // What is turned meets one end, and the other up to what the member bends.
        member.x.forEach((x, i) => found.set(turned(i).map((one, axis) => one + x * (b[axis] - end[axis])), 3 * (starts[m] + i)));
      });
      return found;
    };
    const rotated = (q, t) => {
      const v = q.slice(1), a = cross(v, t).map((one, i) => one + q[0] * t[i]), b = cross(v, a);
      return t.map((one, i) => one + 2 * b[i]);
    };
    const aboutZ = (angle) => [Math.cos(0.5 * angle), 0, 0, Math.sin(0.5 * angle)];
    /** Where places of a curved member are that turns with a node, or with the line between its ends `a` and `b`. */
    const asBody = ({ rest, node }, a, b) => {
      const placed = (i) => [0, 1, 2].map((axis) => rest[3 * i + axis] - rest[axis]), chord = placed(rest.length / 3 - 1);
      const told = node === null ? null : piece(`nodes.${node}.${data.plane ? "angle" : "quaternion"}`);
      const way = Math.atan2(b[1] - a[1], b[0] - a[0]) - Math.atan2(chord[1], chord[0]);
      const q = told === null ? aboutZ(way) : data.plane ? aboutZ(told[0]) : [...told];
      return (i) => rotated(q, placed(i)).map((one, axis) => one + a[axis]);
    };
    /** Results as tables by the keys of the JSON answer, in `found`. */
    const tabled = (found) => {
      for (const one of given.results) {
        const [table, record, key] = one.name.split("."), own = [...results.slice(one.first, one.first + one.size)];
        const value = one.shape.length ? own : own[0];
        if (table === "members") continue;
        if (key === undefined) (found[table] ??= Object.create(null))[record] = value;
        else ((found[table] ??= Object.create(null))[record] ??= {})[key] = value;
      }
      return found;
    };
    const showFields = (values) => {
      for (const { input, number } of fields) {
        input.value = values[number.dataset.at];
        // What is being typed is not written over.
        if (!number.dataset.typed) number.value = Number(values[number.dataset.at].toPrecision(9));
      }
    };
    const say = (text, status) => {
      $("live-status").textContent = text;
      $("live-status").dataset.status = status;
    };
    /** The energies of the state, and how fast it was found. */
    const footer = (what) => {
      const energies = Object.entries(here.told.energy || {}).filter(([, one]) => Number.isFinite(one));
      $("live-energy").textContent = energies.length ? `Energy: ${energies.map(([key, one]) => `${key} ${short(one)}`).join(", ")} J` : "";
      $("live-rate").textContent = spent.time > 0 ? `${Math.round((1000 * spent.count) / spent.time)} ${what} a second` : "";
    };

    // -- equilibria ---------------------------------------------------------------------------------------------------

    function ofEquilibria() {
      let now = null, snapped = false;
      const holds = (status) => status === DONE || status === UNSTABLE;
      const solve = (values, warm) => timed(() => {
        inputs.set(values);
        return code.live_solve_now(warm ? 1 : 0);
      });
      const farthest = (a, b) => a.reduce((most, one, i) => Math.max(most, Math.abs(one - b[i])), 0);

      /** Follow the arguments to new values; what jumps between two near ones has snapped. */
      const follow = (values) => {
        const from = now, before = lines;
        snapped = false;
        if (from) code.live_keep();
        let status = solve(values, from !== null);
        if (from && (!holds(status) || farthest(places(), before) > JUMP * extent)) {
          // Far: by some steps, of which none is much longer than the others, or the structure snaps.
          code.live_back();
          const moves = [];
          let last = before, good = true;
          for (let k = 1; k <= PARTS && good; k++) {
            status = solve(values.map((one, i) => from[i] + (k / PARTS) * (one - from[i])), true);
            good = holds(status);
            if (!good) break;
            const next = places();
            moves.push(farthest(next, last));
            last = next;
          }
          const middle = [...moves].sort((a, b) => a - b)[moves.length >> 1];
          snapped = good && Math.max(...moves) > Math.max(JUMP * extent, SNAPS * middle);
          if (!good) {
            status = solve(values, false);
            snapped = holds(status);
          }
        }
        if (holds(status)) [now, lines] = [values, places()];
        else if (from) code.live_back();
        tell(status, values);
        return status;
      };

      /** What members are coloured by, as of the answer. */
      const sections = () => {
        const found = Object.fromEntries(quantities.map((one) => [one.key, new Float64Array(total).fill(NaN)]));
        members.forEach((member, m) => {
          const [force, moment] = ["force", "moment"].map((key) => piece(`members.${member.name}.${key}`));
          const rest = ownOf(given.tangents, member.name), turns = piece(`members.${member.name}.${data.plane ? "angle" : "quaternion"}`);
          if (!force || !moment || !rest || !turns) return;
          member.x.forEach((_, i) => {
            const vector = (list) => [list[3 * i], list[3 * i + 1], list[3 * i + 2]], at = starts[m] + i, t0 = vector(rest);
            const q = data.plane ? aboutZ(turns[i]) : [...turns.slice(4 * i, 4 * i + 4)];
            const t = rotated(q, t0), f = vector(force), c = vector(moment);
            const across = (v) => Math.hypot(...v.map((one, k) => one - dot(v, t) * t[k]));
            const told = {
              moment: data.plane ? c[2] : across(c), twist: dot(c, t), tension: dot(f, t),
              shear: data.plane ? f[1] * t[0] - f[0] * t[1] : across(f),
            };
            for (const [key, value] of Object.entries(told)) if (found[key]) found[key][at] = value;
          });
        });
        return found;
      };
      const tell = (status, values) => {
        const solved = holds(status), told = { status: sentences[status] };
        const [negative, residual, error] = [report.getInt32(8, true), report.getFloat64(16, true), report.getFloat64(24, true)];
        if (solved) {
          if (snapped) told.snapped = "to an equilibrium that was not near";
          Object.assign(told, { "ways out": negative < 0 ? "not defined" : negative, residual, "error estimate": Number.isFinite(error) ? error : "none" });
          here.at = factor ? values[factor.first] : given.factor;
          here.lines = lines;
          here.values = sections();
          for (const key of Object.keys(ranges)) delete ranges[key];
          showLegend();
          here.told = tabled(told);
          carry();
        } else here.told = { ...here.told, ...told };
        here.stable = solved ? status === DONE : null;
        showFields(values);
        const said = solved ? (status === UNSTABLE ? "unstable" : snapped ? "solved; it snapped" : "solved") : "no solution";
        here.text = `live: ${said}`;
        say(solved ? `${said[0].toUpperCase()}${said.slice(1)}, residual ${residual.toExponential(1)}, estimated error ${Number.isFinite(error) ? error.toExponential(1) : "none"}` : `No solution: ${sentences[status]}. What is shown is the last one.`, status);
        footer("solves");
      };
      return {
        follow, now: () => now, from: () => now || defaults,
        begin: () => follow([...defaults]),
        forget: () => { now = null; },
        restore: () => {
          now = null;
          follow([...defaults]);
        },
        help: "Drag a slider, the tip of a force, or a node that a motion moves: each move is solved from the equilibrium before it.",
      };
    }

    // -- a motion -----------------------------------------------------------------------------------------------------

    function ofMotion() {
      const h = given.step;
      // Arguments go to what is wanted within the steps of a frame: where nodes jump, velocities would not be finite.
      let now = [...defaults], wanted = [...defaults], gone = 0, able = Infinity, time = 0, running = 0, spare = 0, speed = 1, status = DONE, gap = 0;
      // Histories that a slider has taken over, and those of them that go back to their course.
      let taken = new Set(), returning = new Set();
      const driven = given.arguments.filter((one) => given.histories[one.name]).map((one) => [one.first, given.histories[one.name]]);
      const course = ({ t, pieces, value }, at) => {
        if (!pieces.length || at <= t[0]) return pieces.length ? pieces[0][0] : value;
        const after = t.findIndex((one) => one > at), k = after < 0 ? pieces.length - 1 : after - 1;
        const x = after < 0 ? 1 : (at - t[k]) / (t[k + 1] - t[k]);
        return pieces[k].reduceRight((sum, one) => sum * x + one, 0);
      };
      const valuesAt = (at, share) => {
        const found = now.map((one, j) => one + share * (wanted[j] - one));
        for (const [j, history] of driven) if (!taken.has(j)) found[j] = course(history, at);
        return found;
      };
      /** A step, by halves where it is not found; `from` and `to` say how far the arguments have gone to what is wanted. */
      const step = (length, from, to, halvings) => {
        given.times.forEach((share, k) => inputs.set(valuesAt(time + share * length, from + share * (to - from)), k * count));
        status = timed(() => code.live_step_now(length));
        if (status === DONE) [time, gone, gap] = [time + length, to, report.getFloat64(8, true)];
        else if (halvings) {
          const middle = 0.5 * (from + to);
          if (step(0.5 * length, from, middle, halvings - 1) === DONE) step(0.5 * length, middle, to, halvings - 1);
        }
        return status;
      };
      /** So many steps, as far as there is time for them. */
      const advance = (steps, until) => {
        for (const [j, history] of driven) if (returning.has(j)) wanted[j] = course(history, time + steps * h);
        if (wanted.some((one, j) => one !== now[j])) code.live_fresh();
        // No more than there was time for in the frame before.
        const within = Math.max(1, Math.min(steps, able)), share = (k) => Math.min(1, k / within);
        let done = 0;
        gone = 0;
        while (done < steps && performance.now() < until && step(h, share(done), share(done + 1), HALVINGS) === DONE) done++;
        able = done < steps ? Math.max(1, done) : Infinity;
        now = valuesAt(time, gone);
        if (steps && done === steps) {
          for (const j of returning) taken.delete(j);
          returning = new Set();
        }
        for (const [j] of driven) if (!taken.has(j)) wanted[j] = now[j];
        return done;
      };
      const tell = () => {
        if (status !== DONE) {
          // Of the last state that there is.
          inputs.set(now);
          code.live_tell_now();
        }
        lines = places();
        Object.assign(here, { at: time, lines, values: null, told: tabled({ time }), stable: null, text: `live: time ${short(time)} s` });
        carry();
        showFields(wanted);
        const closed = gap > 0 ? `closings met to ${gap.toExponential(1)}, ` : "";
        say(status === DONE ? `Time ${short(time)} s, ${closed}${running ? "running" : "stopped"}` : `Stopped at ${short(time)} s: ${sentences[status]}`, status);
        footer("steps");
      };
      const pause = () => {
        running = 0;
        $("live-run").textContent = "run";
        tell();
      };
      const run = () => {
        const mine = (running = performance.now());
        let before = mine;
        // Where it stopped it is tried again.
        if (status !== DONE) {
          status = DONE;
          inputs.set(now);
          code.live_tell_now();
        }
        stop();
        tell();
        $("live-run").textContent = "stop";
        const span = states[last].at - states[0].at, pace = (span > 0 ? span : data.seconds) / data.seconds;
        const tick = (stamp) => {
          if (running !== mine) return;
          if (state !== known) return pause();
          spare += Math.max(0, Math.min(stamp - before, 100)) * 0.001 * pace * speed;
          before = stamp;
          const wishes = Math.floor(spare / h), done = advance(wishes, performance.now() + FRAME);
          spare = done < wishes ? 0 : spare - done * h;
          if (status !== DONE) pause();
          else if (done) tell();
          if (done) go(known);
          requestAnimationFrame(tick);
        };
        requestAnimationFrame(tick);
      };
      const restart = () => {
        code.live_start();
        [wanted, time, gap, spare, status, taken, returning] = [[...defaults], 0, 0, 0, DONE, new Set(), new Set()];
        now = [...wanted];
        inputs.set(now);
        code.live_tell_now();
        tell();
      };
      const follow = (values) => {
        for (const [j] of driven) {
          if (values[j] === wanted[j]) continue;
          taken.add(j);
          returning.delete(j);
        }
        wanted = values;
        showFields(wanted);
        return status;
      };
      /** From the beginning, with the same arguments all the time, or those of the scene. */
      const steps = (number, values) => {
        pause();
        restart();
        if (values) {
          now = [...values];
          follow([...values]);
          for (const [j] of driven) taken.add(j);
        }
        for (let k = 0; k < number && status === DONE; k++) step(h, 0, 0, 0);
        tell();
        return status;
      };
      return {
        follow, steps, now: () => wanted, from: () => wanted,
        begin: () => {
          restart();
          run();
        },
        restore: () => {
          returning = new Set(taken);
          wanted = wanted.map((one, j) => (driven.some(([k]) => k === j) ? one : defaults[j]));
          showFields(wanted);
        },
        controls: (panel) => {
          const row = made("p", undefined, panel), button = made("button", "run", row), again = made("button", "from the beginning", row);
          button.id = "live-run";
          button.addEventListener("click", () => {
            if (running) return pause();
            go(known);
            run();
          });
          again.addEventListener("click", () => {
            stop();
            restart();
            go(known);
            run();
          });
          const label = made("label", " speed ", row), choice = made("select", undefined, label);
          choice.id = "live-speed";
          SPEEDS.forEach((one) => { made("option", `× ${one}`, choice).value = one; });
          choice.value = "1";
          choice.addEventListener("change", () => { speed = Number(choice.value); });
        },
        help: "The motion is solved as it is seen, step by step. Drag a slider, the tip of a force, or a node that a motion moves, while it runs. A history goes on as in the scene until its slider is moved.",
      };
    }

    // -- what can be moved --------------------------------------------------------------------------------------------

    const solver = given.step ? ofMotion() : ofEquilibria();
    // Arrows of forces and places of nodes that can be dragged.
    const factor = given.arguments.find((one) => one.name === "factor");
    const grown = (handle, values) => {
      const history = handle.history === null ? factor : given.arguments.find((one) => one.name === `histories.${handle.history}`);
      return history ? values[history.first] : handle.history === null ? given.factor : 1;
    };
    const vectorOf = (handle, values, by) => {
      const found = [...handle.value];
      for (const [axis, at] of handle.parts) found[axis] = values[at];
      return found.map((one) => by * one);
    };
    const forces = given.handles.filter((one) => one.kind === "force");
    const pushes = Object.values(answer.told.reactions || {}).map((one) => Math.hypot(...(one.force || [0])));
    const largest = Math.max(0, ...forces.map((one) => Math.hypot(...vectorOf(one, defaults, grown(one, defaults) || 1))));
    const perUnit = ARROW / (largest || Math.max(0, ...pushes) || 1);
    const flat = (v) => [dot(camera.right, v), -dot(camera.up, v)];
    const tip = (handle) => {
      const at = seen(...here.told.nodes[handle.node].position);
      if (handle.kind === "place") return [at, at];
      const values = solver.now(), way = flat(vectorOf(handle, values, grown(handle, values))).map((one) => one * perUnit);
      return [at, [at[0] + way[0], at[1] + way[1]]];
    };
    const drawHandles = (pen) => {
      if (!solver.now()) return;
      for (const [node, { force }] of Object.entries(($("show-symbols").checked && here.told.reactions) || {})) {
        const at = seen(...here.told.nodes[node].position), push = Math.hypot(...(force || [0]));
        // What is much larger than the loads would go through everything.
        const way = force && push ? flat([...force]).map((one) => one * Math.min(perUnit, (1.5 * ARROW) / push)) : [0, 0];
        if (Math.hypot(...way) > 2) arrow(pen, at.map((one, i) => one - way[i]), way, data.inks.reaction, "");
      }
      for (const handle of given.handles) {
        const [from, to] = tip(handle);
        if (handle.kind === "force") arrow(pen, from, [to[0] - from[0], to[1] - from[1]], data.inks.load, "");
        pen.beginPath();
        pen.arc(...to, 6, 0, 2 * Math.PI);
        pen.strokeStyle = handle.kind === "force" ? data.inks.load : data.inks.motion;
        pen.lineWidth = 1.5;
        pen.stroke();
      }
    };
    const handleAt = (x, y) => (solver.now() && given.handles.find((one) => Math.hypot(...tip(one)[1].map((c, i) => c - [x, y][i])) < NEAR)) || null;
    const drag = (handle, dx, dy) => {
      const values = [...solver.now()], by = grown(handle, values) * (handle.kind === "force" ? perUnit : camera.scale);
      if (!by) return;
      const world = camera.right.map((one, i) => (one * dx - camera.up[i] * dy) / by);
      for (const [axis, at] of handle.parts) values[at] += world[axis];
      solver.follow(values);
      go(known);
    };

    const panel = addPanel("Live");
    made("p", "", panel).id = "live-status";
    made("p", "", panel).id = "live-energy";
    if (solver.controls) solver.controls(panel);
    for (const one of given.arguments) {
      one.spans.forEach(([low, high], i) => {
        const row = made("label", `${one.name}${one.size > 1 ? `, ${i}` : ""}, ${one.unit}`, panel), at = one.first + i;
        row.className = "argument";
        const input = made("input", undefined, row), number = made("input", undefined, row);
        Object.assign(input, { type: "range", min: low, max: high, step: (high - low) / 1000 || 1 });
        Object.assign(number, { type: "number", step: "any" });
        input.dataset.at = number.dataset.at = at;
        input.id = `argument-${at}`;
        number.id = `number-${at}`;
        for (const field of [input, number]) {
          field.addEventListener(field === input ? "input" : "change", () => {
            const values = [...solver.from()];
            delete number.dataset.typed;
            // What is no number changes nothing.
            if (Number.isFinite(field.valueAsNumber)) values[at] = field.valueAsNumber;
            stop();
            solver.follow(values);
            go(known);
          });
        }
        number.addEventListener("input", () => { number.dataset.typed = "yes"; });
        fields.push({ input, number });
      });
    }
    const back = made("button", "as in the scene", panel);
    back.addEventListener("click", () => {
      stop();
      solver.restore();
      go(known);
    });
    made("p", solver.help, panel);
    made("p", "", panel).id = "live-rate";
    return { ...solver, drawHandles, handleAt, drag, results, tip, handles: given.handles };
  }
