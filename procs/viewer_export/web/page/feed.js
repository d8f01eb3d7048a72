// What the viewer tells: named values, and tables of rows of bytes (docs/live_page.md). The browser
// connects again by itself and says how far it has come; a viewer that was started again has another epoch, and tells
// all from the beginning.

function bytesOf(base64) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

export class Feed {
  // on: {begin(), values(Map of changed names to values), rows(table, DataView), message(), link(state)}
  //   link state: "open", or "broken" with the time since when
  constructor(on) {
    this.on = on;
    this.values = new Map();
    this.epoch = "";
    this.version = 0;
    this.bytes = 0;
    this.brokenSince = null;
    this.connect();
  }

  connect() {
    this.source = new EventSource("/events" + (this.epoch ? `?since=${this.epoch}:${this.version}` : ""));
    this.source.onmessage = event => this.take(event);
    this.source.onopen = () => this.tell("open");
    this.source.onerror = () => {
      this.tell("broken");
      // Refused, not only broken: the browser does not try again.
      if (this.source.readyState === EventSource.CLOSED) setTimeout(() => this.connect(), 2000);
    };
  }

  tell(state) {
    if (state === "open") this.brokenSince = null;
    else if (this.brokenSince === null) this.brokenSince = performance.now();
    this.on.link(state);
  }

  take(event) {
    this.bytes += event.data.length;
    const message = JSON.parse(event.data);
    if (message.epoch !== this.epoch) {
      this.epoch = message.epoch;
      this.values.clear();
      this.on.begin();
    }
    this.version = message.to;
    const changed = new Map();
    for (const [name, value] of Object.entries(message.set)) {
      this.values.set(name, value);
      changed.set(name, value);
    }
    for (const name of message.gone) {
      this.values.delete(name);
      changed.set(name, undefined);
    }
    for (const [table, rows] of Object.entries(message.rows)) this.on.rows(table, new DataView(bytesOf(rows).buffer));
    if (changed.size > 0) this.on.values(changed);
    this.on.message(message.to === message.newest);
  }

  // Values whose names begin so: pairs of the rest of the name and the value.
  *all(prefix) {
    for (const [name, value] of this.values) if (name.startsWith(prefix)) yield [name.slice(prefix.length), value];
  }
}
