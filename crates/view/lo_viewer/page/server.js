// The WebSocket to the program; `protocol.rs` defines its messages.

/** @import { FromPage, ToPage } from "./protocol.d.ts" */

const decoder = new TextDecoder();

/** Close code of a refused page; `page_socket.rs` defines it. */
const REFUSED = 4001;

/**
 * Connects, and reconnects when the connection is lost. Calls `receive(message, images)` for each message, and
 * `lost(why)` when the connection is lost, with the program's reason or "". Returns a function that sends a message and
 * returns whether there is a connection.
 *
 * @param {(message: ToPage, images: Uint8Array<ArrayBuffer>[]) => void} receive
 * @param {(why: string) => void} lost
 * @returns {(message: FromPage) => boolean}
 */
export function connect(receive, lost) {
  /** @type {WebSocket} */
  let socket;
  let wait = 250;
  const open = () => {
    const address = new URL("socket", location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => {
      wait = 250;
      if (typeof data === "string") {
        receive(JSON.parse(data), []);
        return;
      }
      const length = new DataView(data).getUint32(0, true);
      const message = JSON.parse(decoder.decode(new Uint8Array(data, 4, length)));
      let at = 4 + length;
      const images = message.lengths.map((/** @type {number} */ bytes) => {
        at += bytes;
        return new Uint8Array(data, at - bytes, bytes);
      });
      receive(message, images);
    };
    socket.onclose = ({ code, reason }) => {
      lost(code === REFUSED ? reason : "");
      setTimeout(open, wait);
      wait = Math.min(2 * wait, 5000);
    };
  };
  open();
  return (message) => {
    const isOpen = socket.readyState === WebSocket.OPEN;
    if (isOpen) socket.send(JSON.stringify(message));
    return isOpen;
  };
}
