// What the co-pilot display is heard by: tones and words.
let audio = null;

// Tones come from now on: a page may make them only once somebody has pressed something.
export function wake() {
  audio ??= new AudioContext();
}

export function beep(times, hertz) {
  if (!audio) return;
  for (let i = 0; i < times; i += 1) {
    const tone = audio.createOscillator(), loud = audio.createGain(), at = audio.currentTime + 0.22 * i;
    tone.frequency.value = hertz;
    loud.gain.setValueAtTime(0.2, at);
    loud.gain.exponentialRampToValueAtTime(0.001, at + 0.18);
    tone.connect(loud).connect(audio.destination);
    tone.start(at);
    tone.stop(at + 0.2);
  }
}

// Returns whether there is a voice.
export function speak(text) {
  // Voices of a network would tell somebody where the car is.
  const voice = speechSynthesis.getVoices().find((one) => one.localService && one.lang.startsWith("en"));
  if (!voice) return false;
  const said = new SpeechSynthesisUtterance(text.replaceAll(" · ", ", ").replaceAll("×", "and"));
  said.voice = voice;
  speechSynthesis.cancel();
  speechSynthesis.speak(said);
  return true;
}
