// The way to the program: one WebSocket, text messages as JSON, updates as binary messages (docs/live.md).

const AGAIN_MS = 1000;

// An update taken apart: its head, the least and the largest row of each stretch, and the latest rows.
export function decode(buffer, channels) {
  const headBytes = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, headBytes)));
  const numbers = new Float32Array(buffer, Math.ceil((4 + headBytes) / 4) * 4);
  const row = (k) => numbers.subarray(k * channels, (k + 1) * channels);
  const stretches = head.stretches.map((first, k) => ({ first, least: row(2 * k), largest: row(2 * k + 1) }));
  const rows = Array.from({ length: head.rows }, (_, k) => row(2 * stretches.length + k));
  return { head, stretches, rows };
}

// Connects, and again whenever the connection is lost; `told` takes text messages, `updated` binary ones.
export function connect({ told, updated, linked }) {
  let socket = null;
  const open = () => {
    socket = new WebSocket(`ws://${location.host}/live`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => linked(true);
    socket.onclose = () => { linked(false); setTimeout(open, AGAIN_MS); };
    socket.onmessage = ({ data }) => (typeof data === "string" ? told(JSON.parse(data)) : updated(data));
  };
  open();
  return { send: (message) => socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(message)) };
}
