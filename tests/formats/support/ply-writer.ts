/** Writes PLY files of any layout, so that readers can be held against files whose values are known. */

export type PlyType = 'char' | 'uchar' | 'short' | 'ushort' | 'int' | 'uint' | LongType | 'float' | 'double';
/** In no specification, but in files. */
export type LongType = 'int64' | 'uint64' | 'longlong' | 'ulonglong';
export type PlyEncoding = 'ascii' | 'binary_little_endian' | 'binary_big_endian';

export interface PlyColumn {
  readonly name: string;
  readonly type: PlyType;
  /** Type of the number of values; makes a list property, whose values are arrays. */
  readonly listCountType?: PlyType;
  readonly values: readonly (number | readonly number[])[];
}

export interface PlyWriterElement {
  readonly name: string;
  readonly columns: readonly PlyColumn[];
  /** Number of rows that the header announces; default the number of values. */
  readonly count?: number;
}

export interface PlyWriterOptions {
  readonly encoding?: PlyEncoding;
  readonly newline?: '\n' | '\r\n' | '\r';
  readonly headerLines?: readonly string[];
}

/** The file, header and data. */
export function writePly(elements: readonly PlyWriterElement[], options: PlyWriterOptions = {}): Uint8Array {
  const { encoding = 'binary_little_endian', newline = '\n', headerLines = [] } = options;
  const lines = ['ply', `format ${encoding} 1.0`, ...headerLines];
  for (const { name, columns, count } of elements) {
    lines.push(`element ${name} ${count ?? columns[0]?.values.length ?? 0}`);
    for (const { name: property, type, listCountType } of columns) {
      lines.push(`property ${listCountType ? `list ${listCountType} ` : ''}${type} ${property}`);
    }
  }
  const header = Buffer.from([...lines, 'end_header', ''].join(newline), 'latin1');
  const body = encoding === 'ascii' ? asciiBody(elements, newline) : binaryBody(elements, encoding);
  return new Uint8Array(Buffer.concat([header, body]));
}

function rowsOf({ columns }: PlyWriterElement): (number | readonly number[])[][] {
  return (columns[0]?.values ?? []).map((_, row) => columns.map((column) => column.values[row]));
}

function asciiBody(elements: readonly PlyWriterElement[], newline: string): Buffer {
  const text = (value: number | readonly number[]): string =>
    typeof value === 'number' ? String(value) : [value.length, ...value].join(' ');
  const rows = elements.flatMap((element) => rowsOf(element).map((row) => row.map(text).join(' ') + newline));
  return Buffer.from(rows.join(''), 'latin1');
}

function binaryBody(elements: readonly PlyWriterElement[], encoding: PlyEncoding): Buffer {
  const little = encoding === 'binary_little_endian';
  const parts: Uint8Array[] = [];
  for (const element of elements) {
    for (const row of rowsOf(element)) {
      element.columns.forEach(({ type, listCountType }, k) => {
        const value = row[k];
        if (listCountType) parts.push(scalar(listCountType, (value as readonly number[]).length, little));
        for (const single of [value].flat()) parts.push(scalar(type, single, little));
      });
    }
  }
  return Buffer.concat(parts);
}

function scalar(type: PlyType, value: number, little: boolean): Uint8Array {
  const sizes: Partial<Record<PlyType, number>> = { char: 1, uchar: 1, short: 2, ushort: 2, int: 4, uint: 4, float: 4 };
  const view = new DataView(new ArrayBuffer(sizes[type] ?? 8));
  if (type === 'char') view.setInt8(0, value);
  else if (type === 'uchar') view.setUint8(0, value);
  else if (type === 'short') view.setInt16(0, value, little);
  else if (type === 'ushort') view.setUint16(0, value, little);
  else if (type === 'int') view.setInt32(0, value, little);
  else if (type === 'uint') view.setUint32(0, value, little);
  else if (type === 'float') view.setFloat32(0, value, little);
  else if (type === 'int64' || type === 'longlong') view.setBigInt64(0, BigInt(value), little);
  else if (type === 'uint64' || type === 'ulonglong') view.setBigUint64(0, BigInt(value), little);
  else view.setFloat64(0, value, little);
  return new Uint8Array(view.buffer);
}
