// Compiles the kernels of /kernels one after the other, and tells what the browser says of each.

const tell = (path, value) => fetch(path, { method: "POST", body: JSON.stringify(value) });

async function compile(device, kernel) {
    const begun = performance.now();
    device.pushErrorScope("validation");
    const module = device.createShaderModule({ label: kernel.name, code: kernel.code });
    const info = await module.getCompilationInfo();
    const faults = info.messages.map((m) => ({ line: m.lineNum, text: `${m.type}: ${m.message}` }));
    const group = device.createBindGroupLayout({ entries: kernel.entries });
    const layout = device.createPipelineLayout({ bindGroupLayouts: [group] });
    const compute = { module, entryPoint: "main", constants: kernel.constants };
    try {
        await device.createComputePipelineAsync({ layout, compute });
    } catch (e) {
        faults.push({ line: 0, text: e.message });
    }
    const stray = await device.popErrorScope();
    if (stray) faults.push({ line: 0, text: stray.message });
    return { faults, milliseconds: performance.now() - begun };
}

async function main() {
    const adapter = await navigator.gpu?.requestAdapter();
    if (!adapter) throw new Error("the browser offers no adapter of WebGPU");
    const device = await adapter.requestDevice();
    const found = [];
    for (const kernel of await (await fetch("/kernels")).json()) {
        await tell("/step", kernel.name);
        found.push(await compile(device, kernel));
    }
    return { adapter: `${adapter.info.vendor} ${adapter.info.architecture}`, found };
}

tell("/end", await main().catch((e) => ({ error: String(e) })));
