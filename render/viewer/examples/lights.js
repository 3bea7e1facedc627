// A session's stream of lights, for a page of another server (fishlight live --origin …).

const SCHEMA = "fishlight-light-stream/1";

// Calls onMessage with each moment; returns what ends it. The token goes as a protocol of the
// WebSocket, which unlike an address is in no log.
export function followLights(address, onMessage, onEnd = () => {}) {
  const url = new URL(address);
  const token = url.searchParams.get("token");
  const socket = new WebSocket(`ws://${url.host}/lights`, ["fishlight-lights.1", `fishlight.token.${token}`]);
  socket.onmessage = ({ data }) => {
    const message = JSON.parse(data);
    if (message.schema.split(".")[0] === SCHEMA) onMessage(message);
  };
  socket.onclose = ({ reason }) => onEnd(reason || "the stream has ended");
  return () => socket.close();
}
