// Browsers start no worker on a page that is opened from a folder: there a hidden frame runs the search's script instead.
// mkdocs-material's plug-in `offline` loads a script of this name; without ours it would load one from unpkg.com.
if (location.protocol === 'file:') {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement('iframe');
      frame.hidden = true;
      document.body.append(frame);
      this.inside = frame.contentWindow;
      this.ready = new Promise((resolve) => {
        // What the script posts, it posts to us.
        this.inside.postMessage = (data) => this.dispatchEvent(new MessageEvent('message', { data }));
        const script = frame.contentDocument.createElement('script');
        script.src = url;
        script.onload = resolve;
        frame.contentDocument.body.append(script);
      });
    }

    postMessage(data) {
      this.ready.then(() => this.inside.dispatchEvent(new MessageEvent('message', { data })));
    }

    terminate() {
      this.inside.frameElement.remove();
    }
  };
}
