// What a viewer with the token may ask for: requests, set-points, and where a recording goes on.

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
    element("seek").addEventListener("change", () => {
      this.ask({ seek: { time_s: element("seek").valueAsNumber } });
      this.seeking = false;
    });
    element("seek").addEventListener("input", () => { this.seeking = true; this.showTime(element("seek").valueAsNumber); });
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
    if (about.duration_s) element("seek").max = about.duration_s;
    const fields = document.querySelectorAll("#controls fieldset");
    fields.forEach((field) => { field.disabled = this.token === ""; });
    if (this.token === "") this.answer("To steer, open the whole address that the terminal shows, with what follows #.");
  }

  player({ playing, speed }) {
    this.playing = playing;
    element("play").textContent = playing ? "Pause" : "Play";
    const shown = [...element("speed").options].find((option) => Number(option.value) === speed);
    if (shown) shown.selected = true;
  }

  // The time of what is shown, s.
  time(time_s) {
    if (!this.seeking) {
      element("seek").value = time_s;
      this.showTime(time_s);
    }
  }

  showTime(time_s) { element("seek-time").textContent = `${time_s.toFixed(2)} s`; }

  answer(text) { element("answer").textContent = text; }
}
