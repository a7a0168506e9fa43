/** The element as its own manifest describes it, in the order and the words of the reference. */
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from '../../../scripts/lib/run.mjs';

const path = join(root, 'packages/element/custom-elements.json');

export default function manifest() {
  const { modules } = JSON.parse(readFileSync(path, 'utf8'));
  const declarations = modules.flatMap((module) => module.declarations);
  const element = declarations.find(({ tagName }) => tagName === 'gaussian-splat');
  const members = element.members.map(describeMember);
  const ofElement = members.filter(({ isStatic }) => !isStatic);
  return {
    attributes: element.attributes.map(describeAttribute),
    properties: ofElement.filter(({ kind }) => kind === 'field'),
    methods: ofElement.filter(({ kind }) => kind === 'method'),
    statics: members.filter(({ isStatic }) => isStatic),
    events: element.events.map(describe),
    slots: element.slots.map(describe),
    parts: element.cssParts.map(describe),
    customProperties: element.cssProperties.map(describe),
    states: element.cssStates.map(describe),
    children: declarations.filter(({ tagName }) => tagName?.startsWith('splat-')).map(describeChild),
  };
}

/** A tag among the element's children. */
function describeChild({ tagName, attributes, members, events = [] }) {
  const own = members.map(describeMember).filter(({ attribute }) => attribute === '');
  return { tag: tagName, attributes: attributes.map(describe), members: own, events: events.map(describe) };
}

function describe({ name, description = '', type, default: fallback = '', example = '' }) {
  return { name, description: plain(description), type: type?.text ?? '', fallback, example };
}

/** Attributes, and what kind of field the playground has for them. */
function describeAttribute(attribute) {
  const { name, type, ...rest } = describe(attribute);
  const keywords = [...type.matchAll(/'([a-z-]+)'/g)].map(([, word]) => word);
  const field = type === 'boolean' ? 'checkbox' : keywords.length > 1 ? 'select' : 'text';
  return { name, type, ...rest, keywords, field };
}

function describeMember(member) {
  const parameters = (member.parameters ?? []).map(({ name, optional, type }) => {
    return `${name}${optional ? '?' : ''}${type ? `: ${type.text}` : ''}`;
  });
  return {
    ...describe(member),
    kind: member.kind,
    isStatic: member.static === true,
    isReadonly: member.readonly === true,
    attribute: member.attribute ?? '',
    signature: member.kind === 'method' ? `${member.name}(${parameters.join(', ')})` : member.name,
    returns: member.return?.type?.text ?? '',
  };
}

/** Comments name their neighbors by {@link}; the reference has them as code. */
function plain(text) {
  return text
    .replace(/\{@link ([^}]+)\}/g, '$1')
    .replace(/\s+/g, ' ')
    .trim();
}
