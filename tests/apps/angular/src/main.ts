import { Component, CUSTOM_ELEMENTS_SCHEMA, provideZonelessChangeDetection } from '@angular/core';
import { bootstrapApplication } from '@angular/platform-browser';
import '@gaussian-splat/element';

@Component({
  selector: 'app-root',
  schemas: [CUSTOM_ELEMENTS_SCHEMA],
  template: `<gaussian-splat
    src="/scene.spz"
    alt="A scene"
    loading="eager"
    camera-controls
    style="display: block; width: 300px; height: 200px"
  ></gaussian-splat>`,
})
class App {}

void bootstrapApplication(App, { providers: [provideZonelessChangeDetection()] });
