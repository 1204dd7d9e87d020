// The connection to the program: one WebSocket, text messages as JSON, updates as binary messages (docs/live.md).

const AGAIN_MS = 1000;

// Decodes an update: its head, the least and the largest row of each stretch, and the latest rows.
export function decode(buffer, channels) {
  const headBytes = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, headBytes)));
  // A `Float32Array` can begin only at a multiple of four bytes, up to which the program fills the head.
  const numbers = new Float32Array(buffer, Math.ceil((4 + headBytes) / 4) * 4);
  const row = (k) => numbers.subarray(k * channels, (k + 1) * channels);
  const stretches = head.stretches.map((first, k) => (
    { first, least: row(2 * k), largest: row(2 * k + 1), clipped: head.stretches_clipped[k] }
  ));
  const rows = Array.from({ length: head.rows }, (_, k) => row(2 * stretches.length + k));
  return { head, stretches, rows };
}

// Connects, and reconnects when the connection is lost before the run is over; `received` takes text messages,
// `updated` binary ones.
export function connect({ received, updated, linked }) {
  let [socket, over] = [null, false];
  const open = () => {
    socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => linked(true);
    socket.onclose = () => {
      if (!over) {
        linked(false);
        setTimeout(open, AGAIN_MS);
      }
    };
    socket.onmessage = ({ data }) => {
      if (typeof data !== "string") return updated(data);
      const message = JSON.parse(data);
      // After the end nothing more comes, so a connection that closes then is not opened again.
      over ||= message.kind === "ended";
      return received(message);
    };
  };
  open();
  return { send: (message) => socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(message)) };
}
