// Runs the library by both forms of its engine, and tells what came of it.

import init, { awaited, names, said } from "./barymap_browser.js";

const tell = (path, value) => fetch(path, { method: "POST", body: JSON.stringify(value) });

async function main() {
    await tell("/step", "the module");
    const wasm = await init();
    await tell("/step", "the awaited form");
    const engine = await awaited();
    const check = WebAssembly.promising(wasm.check);
    const checks = [];
    for (const [index, name] of names().entries()) {
        await tell("/step", name);
        await check(index);
        checks.push(said());
    }
    return { engine, checks };
}

addEventListener("error", (e) => tell("/end", { error: e.message }));
tell("/end", await main().catch((e) => ({ error: `${e} ${e.stack}` })));
