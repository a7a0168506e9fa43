/** The webcam as the photograph of the portrait: frames go to the model on this device, and nowhere else. */
const button = document.querySelector('[data-webcam]');
const state = document.querySelector('[data-webcam-state]');
const portrait = button.closest('article').querySelector('gaussian-splat');

button.addEventListener('click', async () => {
  try {
    const video = document.createElement('video');
    video.srcObject = await navigator.mediaDevices.getUserMedia({ video: { width: 480, height: 480 } });
    video.muted = true;
    await video.play();
    portrait.inputValues = { ...portrait.inputValues, image: video };
    portrait.dismissPoster();
    button.remove();
  } catch (error) {
    state.textContent = `No webcam: ${error.message}`;
  }
});
