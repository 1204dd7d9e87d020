// What a viewer with the token may ask for: requests, set-points, and where a recording goes on.

// How long the time bar stays where it was set, if the recording does not come to be there, ms.
const HELD_MS = 1000;
// Keys of the player, and how many samples each goes on.
const STEPS = { ",": -1, ".": 1 };

const element = (id) => document.getElementById(id);

export class Controls {
  // The token stands behind # in the address that the terminal shows.
  constructor(send) {
    this.token = location.hash.slice(1);
    this.ask = (request) => send({ token: this.token, request });
    document.querySelectorAll("[data-request]").forEach((button) => {
      button.addEventListener("click", () => this.ask(button.dataset.request));
    });
    element("set-point").addEventListener("submit", (event) => {
      event.preventDefault();
      const [load, frequency_hz, phase_deg] = ["load", "frequency", "phase"].map((name) => element(`set-${name}`).valueAsNumber);
      this.ask({ set: { load, frequency_hz, phase_deg } });
    });
    element("player").addEventListener("submit", (event) => event.preventDefault());
    element("play").addEventListener("click", () => this.ask(this.playing ? "pause" : "play"));
    // By mouse and by keys; the bar counts samples.
    element("seek").addEventListener("input", () => this.seek(element("seek").valueAsNumber));
    document.querySelectorAll("[data-step]").forEach((button) => {
      button.addEventListener("click", () => this.step(Number(button.dataset.step)));
    });
    element("player").addEventListener("keydown", (event) => {
      if (event.key in STEPS) this.step(STEPS[event.key]);
    });
    element("speed").addEventListener("change", () => this.ask({ speed: { times: Number(element("speed").value) } }));
  }

  // Shows what may be asked for here.
  about(about) {
    const may = (action) => about.actions.includes(action);
    element("controls").hidden = about.actions.length === 0;
    document.querySelectorAll("[data-request]").forEach((button) => { button.hidden = !may(button.dataset.request); });
    element("set-point").hidden = !may("set");
    element("player").hidden = !may("play");
    if (about.steering) {
      element("load-label").textContent = `Load, ${about.unit}`;
      element("set-load").max = about.steering.load_limit;
      element("set-frequency").max = about.steering.frequency_limit_hz;
      element("set-frequency").value ||= about.steering.frequency_hz.toFixed(3);
    }
    this.rateHz = about.rate_hz;
    this.wanted = null;
    if (about.samples) [element("seek").min, element("seek").max] = about.samples;
    const fields = document.querySelectorAll("#controls fieldset");
    fields.forEach((field) => { field.disabled = this.token === ""; });
    if (this.token === "") this.answer("To steer, open the whole address that the terminal shows, with what follows #.");
  }

  player({ playing, speed, sample }) {
    this.playing = playing;
    element("play").textContent = playing ? "Pause" : "Play";
    const shown = [...element("speed").options].find((option) => Number(option.value) === speed);
    if (shown) shown.selected = true;
    if (sample === this.wanted?.sample) this.wanted = null;
  }

  seek(sample) {
    this.wanted = { sample, asked_ms: performance.now() };
    this.showSample(sample);
    this.ask({ seek: { time_s: sample / this.rateHz } });
  }

  step(samples) {
    this.wanted = null;
    this.ask({ step: { samples } });
  }

  // The time of what is shown, s. The bar stays where it was set until the recording is there, so that a key that is
  // held goes on from there.
  time(time_s) {
    if (this.wanted !== null && performance.now() - this.wanted.asked_ms < HELD_MS) return;
    this.wanted = null;
    this.showSample(Math.round(time_s * this.rateHz));
  }

  showSample(sample) {
    const time = `${(sample / this.rateHz).toFixed(3)} s`;
    element("seek").value = sample;
    element("seek").setAttribute("aria-valuetext", time);
    element("seek-time").textContent = time;
  }

  answer(text) { element("answer").textContent = text; }
}
