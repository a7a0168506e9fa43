/** Contents that are easy to create again, and the output of the zstd 1.5 command line tool for them. */

/** A linear congruential generator; its lowest bits are left out because they repeat soon. */
const generator = (seed: number) => () => {
  seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
  return seed >>> 8;
};
const bytes = (length: number, value: (i: number) => number): Uint8Array =>
  Uint8Array.from({ length }, (_, i) => value(i));

export type ContentName = 'words' | 'numbers' | 'noise' | 'repeats' | 'skewed' | 'long' | 'many';

export const zstdContents: Readonly<Record<ContentName, () => Uint8Array>> = {
  words: () => {
    const next = generator(1);
    const words = ['splat ', 'gaussian ', 'alpha, ', 'the ', 'of ', 'camera\n'];
    return new TextEncoder().encode(Array.from({ length: 700 }, () => words[next() % 6]).join(''));
  },
  numbers: () => {
    const next = generator(2);
    return bytes(900, () => 48 + (next() % 10));
  },
  noise: () => {
    const next = generator(3);
    return bytes(300, () => next() % 256);
  },
  repeats: () => new Uint8Array(300_000).fill(7),
  skewed: () => {
    const next = generator(4);
    return bytes(1500, () => Math.min(next() % 40, next() % 200, next() % 9));
  },
  /** More literals than fit into the shorter forms of a block's header. */
  many: () => {
    const next = generator(6);
    return bytes(17_000, () => Math.min(next() % 6, next() % 6, next() % 6));
  },
  /** Three blocks that refer to one another. */
  long: () => {
    const next = generator(5);
    const content = new Uint8Array(270_000);
    for (let i = 0; i < content.length; i++) content[i] = i < 400 ? next() % 256 : content[i - 400 + (i >> 15)];
    return content;
  },
};

export const zstdFixtures: readonly {
  readonly content: ContentName;
  readonly options: string;
  readonly base64: string;
}[] = [
  {
    content: 'words',
    options: '-19',
    base64:
      'KLUv/WCjD2UQAFQCdGhlIGNhbWVyYQphbHBoYSwgZ2F1c3NpYW5zcGxhdG9mb2ZvZoD0qNGHQvtnIERADIKMzAMiEAQQHIiAxSAQmoQ4ICGSSBMY1aZUB7bjtuL07otm9vF8eh7rAaKfp/d1o0CUGMtM21o0RzFeL/u4YUnVpnJn8S7THHnjFcLMeDfmHXZ++0TdTZQijUCcOqZ24jya/c5KyvIIdda6lN+/BAWUze+F+b/4NCSl8OLgXzhS3HzXGTpBRMTh22dRuv5mYSw5WtDgvUcYvFXXqf6wAAhZIQNDLnLRt8V4jECF1xkskEkUQ9XJXispHIBAThM/AxYczG802vQkx40OCItfTkgo0mGclTu7fKa/QAl1vp9LO6wDIsBk8ou+gIq0IIH7wwUBC2UwLfIsvfy7fubvLBOYBOPNGTGHFyowzCelYowLVU5ScwlgduP2Rryl3RAmWFR1zkffWS5VD4VgcftckfKyxfdMnhxew1mrWOI7hwZzq9QJ4gfTt+JvOqF2NNQq9uLrVRiCOkDor6IWPSn65hakUpUA8ZHCl/3Ms0loc3IP1RjVZGnHclyLc6Hkwp0t+6swiUIt21Xk8VTYGQ3QllO/7/MNpfqtCJlzdrbz66V1o0si/WsmpMzEPdWdEz0u810JroPUSrNKS2A13Jp9/Ta7p7RTHDqPLAyUVFZaYHpxOdlcHF2hMr1/',
  },
  {
    content: 'words',
    options: '-1 --no-content-size',
    base64:
      'KLUv/QAY7RYAdAN0aGUgdGhlIGNhbWVyYQphbHBoYSwgZ2F1c3NpYW5zcGxhdHRoZW9mdGhlb2Z0aGVvZm9mb2YggbSo0YcM+3cxBCGMe1l1EkAgoJQKKh2TaEyTlJHCzhhAiJMoPZAOHM7wTMXwG4H3/jAthYU/k0Rx6rZaE1F4qP4FziiwZF2xK1j2SR1FrDZWsbcL6sL2FCEJVtt1r8yfwCtqM/ErW9iiUFTZM3Rz87pEwvA9KM7q0iCKYknDYQIacPic4zkLAInMSqEZO6KJXCyjh6ojsPYD8HeG4IhtWcjFDGg6cSwmtkzMml2AkBGgpdsbwt2X1YHlhyfJcKVIKkMSfpLAKja+Ay/baIpJ9rL5CqbXqAiz5YkS8yRk6Cd3NDh5hYeMXhrMS0V7OgWBl4VFY1WuBjX2zyZEpH2QW0Ae/R362JI1OkV2FfGbcDK/cqpoK4L0bSap18kT/VXoVLucMReCe4aTLEu1U41LeKpaLCNMIcmJmwkWEwBUBZ28XI6y6UCjkLJkbz3gIIRNIWv0zJKaHs0kZh/zc9jhAvoFSKVmGgGRFNKaGhuAuWEUVcRRPtDB/sRoZX1vwa5OoJ3Sf2KZwXp9UjN+dD7CV5BhzXJ4wUEhIAqxWfmNCpg0heEG0lJPfKtLEnKi65aP4iXBOvIcpvHESfDmu2yTdqiZH72yBJzJ4Y09C8rYgdrGWC6K9ztzmcaLyDnhhBMvKV/fXHPZdFvLF06x5mEqwPBn1WUO2dzNFuBbWSsh35WI3vWeD8OXlWn3tZ70q8ihnOg+y4xDlHE5EVlcygYpVzFcDu+cwF1EVmRBHp/5W9cPkQqfRzcgczAO9xmJqEJEWZ7GgS9CJ8kPtehoJlsFp5dmXiTNAV3Iagpp5MH7iFeH2gnlsZW3ncRr2Syog6CrTImQNdws67tBGeHlCUukRNohe/T1AaKpg5k2tOisbka+t9g3/OlAV6Pvf8BsxkDAJdqqAg==',
  },
  {
    content: 'numbers',
    options: '-19',
    base64:
      'KLUv/WCEAoUMAEY4YwjAd6RIelm1nGAAXwBhAD1VCQhjVhF7BlEC78yMRLRBRoAhCIanVWHI6QoHIJ1KBXNSpI/JTHA2/9SPiEXMEhEXT21hQT7cxL5A/A+o0L10YDgUFiAS4i9cWW7xYV4DgPpkeo778QT1nCrGZPVLkiF8/Jxfriym4L5bbCvIIBoTxgvK9JM82GMtyFjFSMnUj01JgHLKNJRH8DKcRW806TRzf9xIJI4NA6xBvBDYATATRXSXCummlfian7GAA4GKAMfAH1nla8sMLMsuio4CPEgviOWw8xZERMy5i8OKzguIKiRANDqMTbDtrSGM+ksfFfkE8VN0AADLJRq6giXjiglQ8zgMgTAg84TY3QkdgYRDx/wzgUWXSIFAR/2QFFQ7hhGUgERi92oMiVijM5vGAxAbEEZP5Cg587SUTkVP2hNgNI9j03FL/lzWDGxp9l2gflbD+HHOUIKy0oWgovyC7Hm9l8kUB1dlzGQgyAzY33z3e8n4/AkBnn4vbi4NvGFrFk0L2KCbmEyX+fMQDgA=',
  },
  {
    content: 'noise',
    options: '-3',
    base64:
      'KLUv/WAsAGEJACU/Fgl+tsBgNYRLpqHsK8FTchTTINv7Qx0qE7Kdo9AGNcrnYrdjSio5cy8CDj0Kz8pFjbRCUK4ViWGglvO81xwU5QfKwaAlBA3yZG5MHjjtEqhWpDRVsPfEKHyKGWUuQsSQeEKablDusAHp6lmPtxsqnG6k9eoD6dB/qY4OntR4RMs5ykTLyugkoL12N5CGWREf17SHD6brrGYmotRny76TlklivriV8mjQ4hPlIqSnyTKQ1OnEmP1X3fLHacARFLPxqgoHNbAMe49Xv2JDEwVR1ZgEGgrbH9PkD/vPqah6ot1bwiFCGjZf3ht7sPTRc6gI8UQc325RH3t8PwUij/FiWFuKC9/VcRK9MEfONeDy0MuZlO1EUJQ6oziTCizFd/JjrGPEDN+7liyUIw==',
  },
  {
    content: 'repeats',
    options: '-19',
    base64: 'KLUv/aDgkwQATAAACAcBAPz/ORACAgAQBwOfBAc=',
  },
  {
    content: 'skewed',
    options: '-3 --check',
    base64:
      'KLUv/WTcBO0UAKpEEAeHIiIiEm4AbwBuADB5QSZelQqosxqRHtjWiIEDCAt8EXV1D7qBR4s/uOKnK1EvQNWMDiBw0JKXBcbLtpbb6U6r1xLgPU1yXgNRI4QzMifbdlDBwjkQtJ7gFil44TU9WuYT23j5yCvAgtBFkdJQ2FcCjkpGBAsO2YEWSbvki5Musel2hHwgSqhdOfdB/Hx2y/iwB4QZDMckiP7/hipuhNv1g0jKcowG4VCYExoEdBYHhwPTA5dXwA7BtU5cAJO0CAiQ1hAPBG2EAg+X0AFOYXPEOIIYM5AzFgaJSMD2UesiDFQ6fdxmTowoZ+nceQjCyc/EvBGdNsYkPH0XJvj1v9rFQ/QjTUHROCLzzT/vlzQuW3oXwpD3MdGYQ1EgnlwuCkpaiHp3DIiGMoCU0EMG7mAA5pnAiZFzOIhT3fjWa7FH44SQLsfAGKaAhgSzWUpbrAEu/22sgASTgf8UHRIz+QiAEzrFF1aCOgJXEHwJeGUJqfVaKiK+Ni1SPnaJeFawgouIbDBR82fhihHFqxFBiVyWoxB+lgWmbJG5XdVnkLCQ44rw3CdEdeFgaLv0MKzRXsJcPxYThDXF8GDaRBJVh0VnYHASBGGokRiFnDMEEaGpaEaStg0QEmMQsvMBEOB1MAO8akcFd/gMfczrgfytlovdbF82WMhezpMzVy9AwgRp1AYP6SB64U9LNvvNb79QgFX1yZ4CYijSokb5biY6jlcRRF0RZ04U0kDi/4olG9LxiMrgS+O6kY8BAaDceuKwkROCJR5/xF3upHzy5hOHpBMewM2kzWCaTw9XwWCd4N/NzFVgDs0EKhL2xuFmi0AA+quXW2eO0GZNxZK9JMI9PVEIxlTW5D7m82itUyCKjYVfJOkRKDv1HiKXBkY7M/g=',
  },
  {
    content: 'long',
    options: '-19',
    base64:
      'KLUv/aCwHgQAJA0ABBnx+CvZjqyjYIVoBVnIkGfJjcgc80j1uFurOhDGrPs3N37cgfKVwoJ7pdAPlqNqO0jCNFrUdhMAvnQqAsuu3XL+WtCnm+zoMiYWSOhkzlTeV0ewZ0X1QRiyjCrDYAHPflWH1JzUkh6yYdfQksFITlL2GzxFRsR//zX1OlWFpNFaPAToYp2JZAEs52gMrhNYliZA2fPY4s23SK5atzqW4wWz0A339s+6IYdIEFUrLnKp5bWFcPlRKz/rtorogNkFgbrtQV3fZiAQc/nIbziYnI00eUG+qg+Zlh4PyupVbDfNUVqFk1hNl9Du+ZBZ1VPXQBOODdzrHhi+4bcau7pOeuh5FtmYYoMdYPlKaRICXSHEgvLpybx9prU0sHtdr4HM1DAjPW77CrO/lOpRnL+4exiBp9WHHStEfRf56880Ay6Pd3+xFCThWe+/20n1DWPlOxCs0RQOKvIVi5FrEEnWoBtOLDWJ3QcP73ocUR/qXV8vLwDdco95sHyOevsi7vkid7Upyc8mftW+xaxpGVeo6fPfBAQy/f8L/f8L/f8DINv8SToFdAAAAARUAAEy/f/+f/+//x89AAAAAQCtvr9A',
  },
  {
    content: 'many',
    options: '-19',
    base64:
      'KLUv/WBoQQWJAA4QRCUEhFQyECUEHwQjBKN8Sp7aGaJX5904cSIgppNSURA9FYmui8aKuoFsNpfGNpsk0UQUJKABnZF2gqSmgJxzNs9AGQgQlyKosQRov5esSKLOETFRsogxqiVaadJZ7kQHrNUSL/KCW1y+eY6ZtHW0Snu0jDSe526xaIpGgBGLWoBW5Ixc0DNJozLmWlK1MmmedZktkcn2EdBmYqSK6R69zp0oDd4rRzVaL1oi6jElXXWsKJFY9aixZ0dJcnXOp5wjmclbxzTWqJRGjNWSxJWSFsdLj6MctUQUAAuUyfwPZBQ/UjeSgftfxN8D/oBL8vGajrP8TTlys7uBnQwk6qxiawFjEqlW+qqWTEt1VfvIceo468a/+5aNlEjE/qQBihQBJ5DRbKkZKNZRVqsi5LwU4JgltgJUbzMispX9MpFHUvf1pwA0IChjSER8Erw5vWVFo1K8piqgrFqtxGAF76DZi6elGBVfDCJxkgD9gazdS9VAnyxyAXEiGAdr1GuwjPoRRavQaMvv6D+I53WJMzOrDNLJTqRLtRpYJyeegVwzNXWdUqkrK1JVGz1tNEAkJ0o5VJfuMyBNNiClObKcT6MsyDjBNkrjmHIWMEc26lbRKVONUa1Km/Jfc9mpmtJkMbNoSsn+zHuy+xOPapG5QZl/YEVDt6Ri4moV1Rbj5F2ZxjKJBLe4JtZcmwfdFczEPEViLRM7+YCNIvt0WxEQ0YgBq5Uxq1qpSMR9J3to8ZQgRWmpJNo3E9IliCTOPat/lm49zrbT8KAkW5WouRY5BhWrRTJHnmDuxIkAjJIqaLnKppMqmZI44iyTGc1pqUSS6rhgnE0QXeICNqYAP0Rdxcgx5BkzclqRsVm02NIl8HhX8nm6msVosShPmrozk/SRbKDeYuBebcSu7X0WpMv7pQF6qpOd1A7WldPMculyUE2A9SKNTDaTSFatQ0+QZSIXpZRiQK35JcVKnLyU4gCa7b2rJHuzROY0B6Cbkp11TGzpNkulNoiNqM0qgVERqZVuZU0+ljGuVKDV9Mxrknf5SB+5Ei3acqXS2BRIxnsuCwRoXhRdU42pIlMjSABE1jYSmZixYkWjVEZmcjPNUpTf5HLkvqKoNRbcMgUe0ZjuTr5oTVWiQFGN1LYkyYtusqUt4oov2bTvfPPkEzxZoqIVBUQ5JlBH210EVZtkpJpy0aV6g1ITMaBc3nNXErF1x3XUNZVRj00Aisa0bU97Mapd3klatBSZ1rYBEYFirFh8PHGvRvGN1aivoATsiXGnGAXkd8ptOgWKZAxcmXkiuimeVAHWqw1Q72rGmFspPy6xUcEpgvOkTmXen0nusqRKlKUniXc5lpw3NWpM1apFAWN0x1ddvRItsKxKnlKv019zTv7aFXFNx1xJdyWYk8TRxRaBRKBOFOnqlrjJHlvexRcNtY7SRPq+FdnJgL7sxdQ6ljZx0iaxky4mssWxqDJxRZVWJvcJ0AHGrzdWTKQ8kphk1iVPsviYubM8tlRFMkm7/hzr4FjbFNPs1UqpozFP5dLmTmVi2zqON4I6eV7z7s2yzMQ4mWZ8zwaXvtjRiRsXrtpSJLfeQHcFxGdXV8xIk5u2APzHn+bnJkH2UpCAs7TTzC+SUisvi7irsooocYqBIzBI5CDAOLmYkNrIklZWSXrXYHI3LrjVxhk/9Vx5s2rNeBIH0MgRWiBGR2NNljk7ZRAF27ZGScknAweYTZT/maXVAKiiGhG3Ek2JWcrpqIwykUUcTSJaLXbO7pJcHrkoqaiySHKSE4BPTlwqOJBdLrfd1IhBQrfWgBcdlWaQ5QNxpSQR3aTZVNOkCqyTLe/SB3NJxql85TItte+8PLZlM1B2RBaVEo1PbONZS/KI3lmOZiToTjLKJGe7ujbHf0sWTGJSR2W9qspmRGmkGLfRRiJ1TZtTO4oIiiQLwJgSA8klNTOfuY6Bqkr4KqoERmLMOJK6MVGvKneobJWKsSowmFjKtVWVJ5CYFieTa5H5mZhI00g0xWaPAtV4HETaVW8ylZoelaKKJl0yRXvVMcjBNlZwBDNTVpHo7/8UjXSgWX32lNIv2T4oIqagCFpRSKtSBcSSmAFQpEAE9CJakVjcyQDZkTKbCByZ2DkwmcAcUGoZGZsqks1LZFxLuTViySJqhWJvTMTIeSqqIJlJtBAj/YPknuTM+pKzmt0yK2rccpd4jRj0eLUjndlNKgHI2lJtayr2spMZ9My8cxIw82KAzXYEBcqS2oB+wPW06KetcpXYYonG8pKPaPEtKnJjMP2TTEnSRSZyIJ8nqHxNEU3MOykN3JWqkFWcxMVd0aVEohj7lblNq0D2FlHW9CcLzHGxczn3iKSt6yhRpvq4yMxzUaemah2vFhVRlmxbMggKTAVKOSalwPUpWz0eyHri3xuYU6Et2JSJzfLsdEUpT9dpEiG2EXJtWUDiF+UYY7JHteqdMqI9oK63c5q44KvaBDqtlGpBmqCrUskVUUB0Bd6+Rp74KNXqKVhNjGjEmBPxGk9NjEHkGeNypVzWHQBqdWqp5awnOorYEa+KipqdCWhGwfbdY9sSjcrzrRmXqWfEj5H2cl3OvohzgwuoEjAiHQep7qo0rINSXpuzeJ05XYVXcdK0iC8BjWjQqdm0l780I0nJo0gVlSdE6nI1pcWUY3mgrZdOMrZF6g3YfXFOTpz5J3GJBfhifWUzkpeX3PZErmIvE8VSVZZbMgd6RHtEtcS2KS4BGJjGnJH088keOXOipGzgbIBm4OvatZ2lWq+KxCqWcaPGrNrPqeI22vS39BHU8s+ZeErzotqBbroXkH3iKErnVp9RtUjUgs0GOdsl8i+aGnAHtDn/LYlG7tobVIlEahmUeCPJUpk0gzS6XWYJJB3rdFk0IJc3xtlqSZuRZZK0kdibsrLIpYDogKl2qVImkIJ2VxOdlySCSLJiMmDiTy9XJjeTjZCM6EAr58GLStGrZBLbvQKJMq5KgEWg0c3j82iRJRCUOSWurMzkqWOMI6ZxryRYSsnKesValpOyHqOt9JHp3lLbsaY6kheZLr13BYLmV4IdJ9MS+dToZvliIi4DNY2kAFNGbYGwJ3HJM5InoFuSRvYVP/A1cwoS8Xw37qS0BQGXgat7njwB1m7BI1q1MkYSkUmcRmqjm/ZI093JuBiXaYRm6UFdQE8yIv2T0ggK6sEzL+me1GmiSlsvNsh6XE3fHcgq1+f5SHM+kGlkT9DEVUbsHGkWi9NIEk2BBBLRyroKUlXnmMrpKo16smTXR+N0TEVwMBn/GNk4dmM7GsROVLU4mbW0mgKSHWXgKHbrwAdWkL7uQS8ZdVbw/ALM0xRB8jLLPjO1BxKnSGwvuZTUgapivAhwSYpIaXVt90wDGqv8aqoiM01QJzpJkExNknNjMm0FJ3pO8QC9SX+3VGdJkXyVpTSnvVGSgsXVNrOpjE5OVnJeRgKV8y+TXlviOn4m8vGssdampl03i4pVS5Q0anFKEa08AI1MhV1Z2QEpnTfN70mnJM+K+5x40eM/UVc1srZTWoFSxRKs4h9cF3M5VRorY35ZffkC5w86OWMqEsvjulSMmrkcIDpQJCsWjQioRhtJHIkyD9ZKpttpK1k0OVi3z+QmyDmg0diUqmqmJpITkQd6TopxalaJmhJUUas8NqkbTNaIxy9uGFUFbQZFmrcEAPlebWtNIiZvlo1EYi+Bu0BrTWBxChjRQKlJl5mXzKiA9LI9Uke+/QJ9Tp9/MTvuntKZj9UDs7lwVJtkjTpH1aFqNtqabKp3wPTutjtL3gxIp77MJyNGUMmiPvAijcxi0OgXRaKAVLS0WTTWtriuz1OtBUhJteJgszSZImJ6QXzzGWACLYHa0RRZM35Z1gWqwGpVBZJYVCSqKJchb+ovWGfdVpfi4t3iBZNyNm5KVnptpJQuNXEvHZSkUrZ5UU2yKlpU2VIpwZeUknTqVFc0rUiyvj3FRXILmMrNwtK4ppMBEllANNnXRUXIVJHAnailqvyWZmwaUhHvgGrUmITBeQI0pqsNmDLHfawuBZlNCkTtgZNOqnV5Zl25Ag0rsWk5t691diMCWgImif9sAg4A49yTI5eVRFlpgDNLkvFmBrmpkk5WFKeLEquIcjsZ6bI6saitmKJW01lZxADMDiUggZkMyGYauTKQnrj0TZ6eKq1llWYRVFvpFJteMuZqXZPNljJl83KbUxdwTj7QkqxJtDhl9t6YFxejcchEVWW9iI014249CQDS9cyMSbuTaWpGoJmpLwQC1YkaLeJPyaWkzIhpRR9xrCLpdJl7kTX1JwlmPLomSspEZi9zJYllnQFi11WkxCiuUTw5r56lRYloVRFI07JVXg5UkgFOL+p+IlKYxxGnXIoL7iVKBereA6kp06wkEUsbiQkR1ck4wUlc/po532vELqo8f1p85CSD1ERx7EJ7p6KyOhEL6vVBTDN/xC09kmhyqicXrWTxAAje4uRxGXMkGE1SniibpK60uhNT1FYx1hacJZiaqLEb0RIHxir/muQt5T5ZtHW8NMqlXTQunmwWKbWDVAU2RRGRGjlpP3VsPkqTVlwliZ9zfjY2Sm4+487IEyc9LXmxSVKaiuo7FaVivCi1KO81wJVbaad4DAgR6QIkGpcRyAekddr8sZFJkmLTnZn45WTOGmECyWvdK7ZEeMRm3AvW0gqQUmYzugpk0h2wI+8tdW8kp7G3aza1OG4da8TgRUkGIjrXpv56YT+mhTxGtiQ6+kjq+s5nQKwxZiiJ6qX0PaWiRAHTioyrRqRExODSDqTvqAGZJLY9dpNnMYLIHfFBueVM9YqbB89Y7kGtEkeJayISLxcRrTpoywaYTUprEmXKWr7Tgintkk0axJN7npSJKOKAzI0ab5L5WNXoay26qI5azMQdZ46URHFiZHTFnM37Xj62PA9axtysjuel59OkzU5Xj123RSOjuFrFTj4SWeQqjSZUkjb/i3ETUUpeslGnRyRjiIGZ0ypzSTeRcppqFaCQNVWgVO1G0IyZXSrxWqKsmFFlL1cgtaZJ0g6iQF6z3JjzTEurSYKSHTOKuYsqEm8nVmAZ9RoZtEillprPXKz8Rcw2SNbYSmyUmj5R0Ue5kilaBGpJRSqJh1pVCayRIwAZnOK8l7olb8BMl9Ik675Bmj1Q3FPq/N65vwHZytipNdsiVivTVIGkSiU1Fbki2GbTk17kKfHmktJm4quxLCW1eyDYr0XXWUTEW5WlKD6bpng0epFkuY06KHOmWXpH00wOwIHTZLyqAhPBBTXnoMDkaaPJRKvURakqPh6pBLNtr8TH21xZ6QhIY15H/8wA469bJAEgZm6kss+4Xpc3FmmMRQVopYkFOdlMbCR6X1NNZQS9nJh5ru9BlpJYBQx0BUnE9g6kLlsiVakkSqKuGNcgLhjMCzA7W0EXG43JeUyUTq884/ntIlLFdMtLKadgMVOg4s2JmxQlam0bpwCkNHvcM76UCqP12A70za6fk3uDxdOayaBHepHJl0oF1BlJJXWF2IpWILGscwFpMKuM5UCtZdcsKscJUrmPqay6Y0m7zlJEvLFG06Wjs4n+KGpVipjEGdO1XESaOEmkGF28TrNZzomaPQkiUrMWbBAzecU0+ecZKbpJ1gBHMkKB0FcHW0ZamdlxG4lIFkEtr7YyJ7kk062rROfrFeBoJggQECFCGK4OHYaRiSIqy7UlV/yFdMBuTIL9hqmYAq1PPfLOU3g5nAoURNMuc0o+1erhkI2EVExFNDmdXf5SUidY25V9Q15MVhIHzhKdOC4PJgxolguUDM2TA8UHgJw0K798eu/jk45Fi69MYw9k+idKEWqUVByJyBq8CS3qNATD0YLthyk=',
  },
];
