// Suspends the WebAssembly that calls it, until the browser has done what is due. A message comes
// sooner than a timer, which browsers delay.

const { port1, port2 } = new MessageChannel();
let resume = () => {};
port1.onmessage = () => resume();

export const pause = new WebAssembly.Suspending(
    () =>
        new Promise((resolve) => {
            resume = resolve;
            port2.postMessage(0);
        }),
);
