// Red on a loss, green on a merge, with a tone if it is wanted.
import {at, element} from "/page/words.js";

const kShownMs = 12000;

export class Alarms {
  constructor() {
    this.isOn = localStorage.getItem("mapmend-sound") === "1";
    this.context = null;
    at("sound").addEventListener("click", () => this.toggle());
    this.tell();
    // Browsers let a page be heard only after somebody has touched it.
    if (this.isOn) addEventListener("pointerdown", () => this.open(), {once: true});
  }

  toggle() {
    this.isOn = !this.isOn;
    localStorage.setItem("mapmend-sound", this.isOn ? "1" : "0");
    if (this.isOn) this.open(), this.tone([660], 0.1);
    this.tell();
  }

  tell() {
    at("sound").textContent = this.isOn ? "Sound on" : "Sound off";
    at("sound").setAttribute("aria-pressed", String(this.isOn));
  }

  open() {
    this.context ??= new AudioContext();
    this.context.resume();
  }

  tone(frequencies, seconds) {
    if (!this.isOn || !this.context) return;
    frequencies.forEach((frequency, i) => {
      const oscillator = new OscillatorNode(this.context, {frequency}), gain = new GainNode(this.context, {gain: 0});
      const start = this.context.currentTime + i * seconds;
      gain.gain.setValueAtTime(0, start);
      gain.gain.linearRampToValueAtTime(0.25, start + 0.02);
      gain.gain.linearRampToValueAtTime(0, start + seconds);
      oscillator.connect(gain).connect(this.context.destination);
      oscillator.start(start);
      oscillator.stop(start + seconds);
    });
  }

  // kind: "loss", "merge" or "note"
  show(kind, text) {
    const box = element("div", {class: `alarm ${kind}`}, element("span", {}, text),
      element("button", {type: "button", "aria-label": "Dismiss", onclick: () => box.remove()}, "×"));
    at("alarms").append(box);
    while (at("alarms").children.length > 4) at("alarms").firstChild.remove();
    setTimeout(() => box.remove(), kShownMs);
    if (kind === "loss") this.tone([330, 247, 330, 247], 0.25);
    if (kind === "merge") this.tone([523, 659, 784], 0.16);
  }
}
