// The WebSocket to the program; `protocol.rs` says what goes over it.

const decoder = new TextDecoder();

/** Connects, and again when the connection breaks. `hear(message, pictures)` gets all messages, `lost()` when there is no connection. */
export function connect(hear, lost) {
  let socket = null;
  let wait = 250;
  const open = () => {
    const address = new URL("socket", location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => { wait = 250; };
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") {
        hear(JSON.parse(data), []);
        return;
      }
      const length = new DataView(data).getUint32(0, true);
      const message = JSON.parse(decoder.decode(new Uint8Array(data, 4, length)));
      let at = 4 + length;
      const pictures = message.lengths.map((bytes) => {
        at += bytes;
        return new Uint8Array(data, at - bytes, bytes);
      });
      hear(message, pictures);
    };
    socket.onclose = () => {
      lost();
      setTimeout(open, wait);
      wait = Math.min(2 * wait, 5000);
    };
  };
  open();
  /** Sends a message; `false` where there is no connection. */
  return (message) => {
    const isOpen = socket.readyState === WebSocket.OPEN;
    if (isOpen) socket.send(JSON.stringify(message));
    return isOpen;
  };
}
