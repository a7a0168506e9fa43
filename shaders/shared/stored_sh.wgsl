// Where the words of the harmonics are: in a buffer. WebGL has webgl/textured_sh in place of this.
fn sh_word(i: u32) -> vec2u {
  return sh[i];
}
