// Pages that are opened from the disk may start no worker, and the search is one: its script runs in a frame that is not shown.

if (location.protocol === "file:") {
  window.Worker = class {
    constructor(url) {
      this.frame = Object.assign(document.createElement("iframe"), { hidden: true });
      document.body.append(this.frame);
      this.scope = this.frame.contentWindow;
      this.scope.postMessage = (data) => this.onmessage?.(new MessageEvent("message", { data }));
      this.ready = new Promise((onload) => {
        const onerror = () => this.onerror?.(new Event("error"));
        this.scope.document.body.append(Object.assign(this.scope.document.createElement("script"), { src: url, onload, onerror }));
      });
    }

    postMessage(data) {
      this.ready.then(() => this.scope.dispatchEvent(new MessageEvent("message", { data })));
    }

    terminate() {
      this.frame.remove();
    }
  };
}
