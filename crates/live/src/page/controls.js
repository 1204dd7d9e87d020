// Requests of a viewer with the token: states, set-points, and the playback of a recording.

// How long the time bar stays where it was set if the recording does not get there, ms.
const HELD_MS = 1000;
// Keys of the player, and by how many samples each steps.
const STEPS = { ",": -1, ".": 1 };
// The numbers of a set-point, and their form fields.
const FIELDS = { load: "set-load", frequency_hz: "set-frequency", phase_deg: "set-phase" };

const element = (id) => document.getElementById(id);
const form = element("set-point");

export class Controls {
  constructor(send) {
    Object.assign(this, { about: null, isLinked: false, isOver: false, asked: null, isEdited: false, wanted: null });
    this.ask = (request) => {
      this.answer("");
      send({ token: this.token, request });
    };
    document.querySelectorAll("[data-request]").forEach((button) => {
      button.addEventListener("click", () => this.ask(button.dataset.request));
    });
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.set();
    });
    // Editing a refused set-point clears the answer, so that it can be requested again.
    form.addEventListener("input", () => {
      this.isEdited = true;
      if (form.checkValidity()) this.answer("");
    });
    this.preparePlayer();
    this.takeToken();
    addEventListener("hashchange", () => this.takeToken());
  }

  preparePlayer() {
    element("player").addEventListener("submit", (event) => event.preventDefault());
    element("play").addEventListener("click", () => this.ask(this.playing ? "pause" : "play"));
    // By mouse and by keys; the bar counts samples.
    element("seek").addEventListener("input", () => this.seek(element("seek").valueAsNumber));
    document.querySelectorAll("[data-step]").forEach((button) => {
      button.addEventListener("click", () => this.step(Number(button.dataset.step)));
    });
    element("player").addEventListener("keydown", (event) => {
      if (event.key in STEPS && !element("play").matches(":disabled")) this.step(STEPS[event.key]);
    });
    element("speed").addEventListener("change", () => this.ask({ speed: { times: Number(element("speed").value) } }));
  }

  // The token follows # in the address that the terminal shows; a viewer without it can add it later.
  takeToken() {
    this.token = location.hash.slice(1);
    this.answer("");
    this.enable();
  }

  // Shows the controls for the permitted requests.
  show(about) {
    Object.assign(this, { about, isOver: false, asked: null, wanted: null });
    const may = (action) => about.actions.includes(action);
    element("controls").hidden = about.actions.length === 0;
    document.querySelectorAll("[data-request]").forEach((button) => { button.hidden = !may(button.dataset.request); });
    form.hidden = !may("set");
    element("player").hidden = !may("play");
    element("load-label").textContent = `Load, ${about.unit}`;
    for (const [name, [least, most]] of Object.entries(about.steering ?? {})) {
      [element(FIELDS[name]).min, element(FIELDS[name]).max] = [least, most];
    }
    if (about.samples) [element("seek").min, element("seek").max] = about.samples;
    this.answer("");
    this.enable();
  }

  linked(isLinked) {
    this.isLinked = isLinked;
    this.enable();
  }

  // No more requests are possible.
  end() {
    this.isOver = true;
    this.answer("");
    this.enable();
  }

  enable() {
    const can = this.token !== "" && this.isLinked && !this.isOver;
    document.querySelectorAll("#controls fieldset").forEach((field) => { field.disabled = !can; });
    if (this.token === "" && !this.isOver) {
      this.answer("To steer, open the whole address that the terminal shows, with what follows #.");
    }
  }

  set() {
    const numbers = Object.entries(FIELDS).map(([name, id]) => [name, element(id).valueAsNumber]);
    const wanted = Object.fromEntries(numbers);
    this.ask({ set: wanted });
    this.asked = wanted;
    this.answer(`requested: ${this.words(wanted)}`);
  }

  // The exciter's set-point, for all viewers. A form that has not been edited shows it, too.
  setPoint(now) {
    element("set-point-now").textContent = `set: ${this.words(now)}`;
    if (this.asked !== null && Object.keys(FIELDS).every((name) => this.asked[name] === now[name])) {
      Object.assign(this, { asked: null, isEdited: false });
      this.answer("");
    }
    // A form in which somebody writes must not change under the hands.
    if (this.isEdited || form.contains(document.activeElement)) return;
    for (const [name, id] of Object.entries(FIELDS)) {
      const [rounded, [least, most]] = [Number(now[name].toPrecision(6)), this.about.steering[name]];
      // Six digits are enough to read, but at the end of a range they may round beyond it, and the form would be
      // invalid.
      element(id).value = rounded >= least && rounded <= most ? rounded : now[name];
    }
  }

  words({ load, frequency_hz, phase_deg }) {
    const short = (number) => String(Number(number.toPrecision(6)));
    return `${short(load)} ${this.about.unit} at ${short(frequency_hz)} Hz, ${short(phase_deg)}°`;
  }

  // The exciter did not accept the set-point that was requested.
  notTaken() {
    if (this.asked !== null) this.refused(`the exciter did not accept ${this.words(this.asked)}`);
  }

  refused(why) {
    this.asked = null;
    this.answer(why, "refused");
  }

  // The cause of a refusal may be over in another state.
  stateChanged() {
    if (element("answer").className === "refused") this.answer("");
  }

  answer(text, kind = "") {
    element("answer").textContent = text;
    element("answer").className = kind;
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
    this.ask({ seek: { time_s: sample / this.about.rate_hz } });
  }

  step(samples) {
    this.wanted = null;
    this.ask({ step: { samples } });
  }

  // The time shown, s. The bar stays where it was set until the recording is there, so that a key that is
  // held down continues from there.
  time(time_s) {
    if (this.wanted !== null && performance.now() - this.wanted.asked_ms < HELD_MS) return;
    this.wanted = null;
    this.showSample(Math.round(time_s * this.about.rate_hz));
  }

  showSample(sample) {
    const time = `${(sample / this.about.rate_hz).toFixed(3)} s`;
    element("seek").value = sample;
    element("seek").setAttribute("aria-valuetext", time);
    element("seek-time").textContent = time;
  }
}
